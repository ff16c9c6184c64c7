#pragma once

#include <numbers>

namespace sateen {

// Angles are radians in code and degrees in front of people.
inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

}  // namespace sateen
