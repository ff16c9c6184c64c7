#pragma once

#include <span>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// Image shrunk by a whole factor to at most `max_width`, from bands of its rows. Each pixel is the
// mean of the known pixels of its square; zero if none is known.
class Thumbnail {
 public:
  Thumbnail(ImageSize size_px, int max_width, size_t channels);

  // Adds rows: one image per channel. A pixel counts where `known` is not zero; null: where finite.
  void Add(int first_row, std::span<const Image<float>> planes, const Image<uint8_t>* known);

  [[nodiscard]] int Factor() const { return factor_; }
  [[nodiscard]] Image<float> Mean(size_t channel) const;
  [[nodiscard]] Image3 Means() const { return Colours(Mean(0), Mean(1), Mean(2)); }
  // Returns 255 where any pixel counted.
  [[nodiscard]] Image<uint8_t> Known() const;

 private:
  static Image3 Colours(Image<float> red, Image<float> green, Image<float> blue);

  int factor_ = 1;
  std::vector<Image<float>> sums_;
  std::vector<Image<float>> counts_;
};

}  // namespace sateen
