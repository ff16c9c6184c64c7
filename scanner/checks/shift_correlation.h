#pragma once

#include <Eigen/Core>

#include "imaging/image.h"

namespace sateen {

// How far the second picture lies from the first, both lit alike, and how sure that is: the
// correlation there, 1 at most.
struct Correlation {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double peak = 0.0;
};

/// Finds the highest cross-correlation of both pictures, less their Gaussian blur, over all shifts,
/// and the top of the parabola through it and its neighbours.
[[nodiscard]] Correlation ShiftBetween(const Image<float>& first, const Image<float>& second);

}  // namespace sateen
