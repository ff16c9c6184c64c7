#pragma once

#include <array>
#include <vector>

#include "imaging/image.h"

namespace sateen {

using Rgb8 = std::array<Image<uint8_t>, 3>;

// Encodes (n + 1) / 2 as 16-bit integers; unsolved pixels, whose normal is zero, become mid grey.
[[nodiscard]] std::array<Image<uint16_t>, 3> EncodeNormal16(const Image3& normal);

// Returns the 99.5th percentile of the brightest channel, for ShowLinear(); 1 without light.
[[nodiscard]] float WhiteOf(const Image3& linear);
// Shows linear RGB as sRGB; `white` and above become white.
[[nodiscard]] Rgb8 ShowLinear(const Image3& linear, float white);
[[nodiscard]] inline Rgb8 ShowLinear(const Image3& linear) {
  return ShowLinear(linear, WhiteOf(linear));
}
[[nodiscard]] Rgb8 ShowNormal(const Image3& normal);
// Shows values as heat: 0 is black, then purple, red and yellow; `top` and above are white. Pixels
// where `shown` is zero are grey.
[[nodiscard]] Rgb8 ShowHeat(const Image<float>& values, float top, const Image<uint8_t>& shown);
// Shows heights in the colours of ShowHeat(): the lowest black, the highest white.
[[nodiscard]] Rgb8 ShowRelief(const Image<float>& height);

// Shrinks a picture by a whole factor so that it is at most `max_width` wide.
[[nodiscard]] Rgb8 Shrunk(const Rgb8& panel, int max_width);
// Shows each pixel as a square of `factor` x `factor`.
[[nodiscard]] Rgb8 Enlarged(const Rgb8& panel, int factor);
// Lays out panels of one size in rows of `columns`.
[[nodiscard]] Rgb8 ContactSheet(const std::vector<Rgb8>& panels, int columns);
// Lays out panels in a row, each shrunk to at most `max_width`.
[[nodiscard]] Rgb8 SideBySide(const std::vector<Rgb8>& panels, int max_width);

}  // namespace sateen
