#pragma once

#include <array>
#include <vector>

#include "imaging/image.h"

namespace sateen {

using Rgb8 = std::array<Image<uint8_t>, 3>;

// (n + 1) / 2 as 16-bit integers; unsolved pixels, whose normal is zero, become mid grey.
[[nodiscard]] std::array<Image<uint16_t>, 3> EncodeNormal16(const Image3& normal);

// The 99.5th percentile of the brightest channel, for ShowLinear(); 1 for an image without light.
[[nodiscard]] float WhiteOf(const Image3& linear);
// Linear RGB as sRGB, `white` and above as white.
[[nodiscard]] Rgb8 ShowLinear(const Image3& linear, float white);
[[nodiscard]] inline Rgb8 ShowLinear(const Image3& linear) {
  return ShowLinear(linear, WhiteOf(linear));
}
[[nodiscard]] Rgb8 ShowNormal(const Image3& normal);
// 0 is black, `top` and above are white, by way of purple, red and yellow; pixels where `shown` is
// zero are grey.
[[nodiscard]] Rgb8 ShowHeat(const Image<float>& values, float top, const Image<uint8_t>& shown);
// Heights from the lowest, black, to the highest, white, in the colours of ShowHeat().
[[nodiscard]] Rgb8 ShowRelief(const Image<float>& height);

// Shrunk by a whole factor so that it is at most `max_width` wide.
[[nodiscard]] Rgb8 Shrunk(const Rgb8& panel, int max_width);
// Each pixel as a square of `factor` x `factor`.
[[nodiscard]] Rgb8 Enlarged(const Rgb8& panel, int factor);
// Panels of one size in rows of `columns`.
[[nodiscard]] Rgb8 ContactSheet(const std::vector<Rgb8>& panels, int columns);
// The panels, shrunk to at most `max_width` each, in a row.
[[nodiscard]] Rgb8 SideBySide(const std::vector<Rgb8>& panels, int max_width);

}  // namespace sateen
