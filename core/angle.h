#pragma once

#include <cmath>
#include <numbers>

namespace sateen {

// Angles are radians in code and degrees in front of people.
inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

// Returns the angle between two vectors of three components, of any length, in [0, pi]:
// atan2(|a x b|, a . b), which is exact for small angles where acos(a . b) is not.
template <typename A, typename B>
[[nodiscard]] double AngleBetweenRad(const A& a, const B& b) {
  return std::atan2(static_cast<double>(a.cross(b).norm()), static_cast<double>(a.dot(b)));
}

}  // namespace sateen
