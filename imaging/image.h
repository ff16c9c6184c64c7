#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace sateen {

struct ImageSize {
  int width = 0;   // [px]
  int height = 0;  // [px]

  friend bool operator==(const ImageSize&, const ImageSize&) = default;
  [[nodiscard]] size_t PixelCount() const {
    return static_cast<size_t>(width) * static_cast<size_t>(height);
  }
};

// Dense row-major plane; owns its pixels and copies by value. Row down, column right.
template <typename T>
struct Image {
  int width = 0;   // [px]
  int height = 0;  // [px]
  std::vector<T> pixels;

  Image() = default;
  Image(int width_px, int height_px, T fill = T())
      : width(width_px),
        height(height_px),
        pixels(static_cast<size_t>(width_px) * static_cast<size_t>(height_px), fill) {}
  explicit Image(ImageSize size, T fill = T()) : Image(size.width, size.height, fill) {}

  [[nodiscard]] ImageSize Size() const { return {width, height}; }
  T& At(int x, int y) { return pixels[Index(x, y)]; }
  const T& At(int x, int y) const { return pixels[Index(x, y)]; }
  [[nodiscard]] size_t Index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  }
};

// Three planes of one size: red, green, blue, or the x, y, z of a vector field. Planar, because
// the solver reads one component of many pixels at a time.
struct Image3 {
  std::array<Image<float>, 3> planes;

  Image3() = default;
  explicit Image3(ImageSize size, float fill = 0.0F)
      : planes{Image<float>(size, fill), Image<float>(size, fill), Image<float>(size, fill)} {}

  [[nodiscard]] ImageSize Size() const { return planes[0].Size(); }
  Image<float>& operator[](size_t c) { return planes[c]; }
  const Image<float>& operator[](size_t c) const { return planes[c]; }
};

using Mask = Image<uint8_t>;  // 0 outside, otherwise inside

}  // namespace sateen
