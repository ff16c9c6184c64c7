#pragma once

#include <array>

namespace sateen {

// Rec. 709 luminance of linear RGB (ITU-R BT.709-6, item 3.2).
inline constexpr std::array<float, 3> kLuminance = {0.2126F, 0.7152F, 0.0722F};

// Converts by IEC 61966-2-1, both ways; 0 and 1 map to themselves exactly, negative input is
// mirrored.
[[nodiscard]] float LinearFromSrgb(float encoded);
[[nodiscard]] float SrgbFromLinear(float linear);

}  // namespace sateen
