#pragma once

#include <Eigen/Core>
#include <array>

#include "imaging/light_stack.h"

namespace sateen {

// Weights by h of (1) below for a shift along a line: six samples, from `first` on, relative to the
// place.
struct LanczosWindow {
  int first = 0;
  std::array<float, 6> weights = {};
};

[[nodiscard]] LanczosWindow LanczosAt(double shift);

/// Lays a frame that has moved by `shift_px` over the first one, by Lanczos' window of six samples:
///
///     i'(x) = sum_m h(x + shift - m) i(m) / sum_m h(x + shift - m),
///     h(t) = sinc(t) sinc(t / 3),  |t| < 3                                              (1)
///
/// along rows, then along columns. A channel's sample that is made from a saturated one is
/// saturated. One that is made from a sample that is not finite is not finite. What the frame has
/// not seen is NaN, which the solver leaves out; at the border the picture continues as its mirror
/// image.
///
/// Cost     12 multiplications per sample, one more plane of memory; nothing if the shift is zero
/// Source   Duchon, "Lanczos filtering in one and two dimensions", J. Applied Meteorology 18, 1979
void LayOverFirst(const Eigen::Vector2d& shift_px, LightFrame& frame);

}  // namespace sateen
