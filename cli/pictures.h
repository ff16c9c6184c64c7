#pragma once

#include <array>
#include <vector>

#include "imaging/image.h"

namespace sateen::cli {

using Rgb8 = std::array<Image<uint8_t>, 3>;

// (n + 1) / 2 as 16-bit integers; unsolved pixels, whose normal is zero, become mid grey.
[[nodiscard]] std::array<Image<uint16_t>, 3> EncodeNormal16(const Image3& normal);

// Linear RGB as sRGB; the 99.5th percentile of the brightest channel maps to white.
[[nodiscard]] Rgb8 ShowLinear(const Image3& linear);
[[nodiscard]] Rgb8 ShowNormal(const Image3& normal);
// 0 is black, `top` and above are white, by way of purple, red and yellow; pixels where `shown` is
// zero are grey.
[[nodiscard]] Rgb8 ShowHeat(const Image<float>& values, float top, const Image<uint8_t>& shown);

// The panels in a row, shrunk by whole factors so that each is at most `max_width` wide.
[[nodiscard]] Rgb8 SideBySide(const std::vector<Rgb8>& panels, int max_width);

}  // namespace sateen::cli
