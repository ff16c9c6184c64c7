#pragma once

#include <concepts>
#include <limits>

namespace sateen {

// Returns the value without its fraction, or the nearest number that the type has; 0 for NaN. A
// static_cast of a double that is out of range may give anything.
template <std::integral Whole>
[[nodiscard]] constexpr Whole ClampedTo(double value) {
  using Limits = std::numeric_limits<Whole>;
  // The highest value of a 64-bit type rounds up to 2^63 or 2^64, which is out of range already.
  if (value >= static_cast<double>(Limits::max())) {
    return Limits::max();
  }
  if (value <= static_cast<double>(Limits::min())) {
    return Limits::min();
  }
  return value == value ? static_cast<Whole>(value) : Whole{0};
}

}  // namespace sateen
