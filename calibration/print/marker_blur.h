#pragma once

#include <Eigen/Core>

#include "calibration/print/print_fit.h"

namespace sateen {

// Whiteness of a place in a marker, 0 to 1, and its derivatives by the place and the logarithm of
// the blur.
struct White {
  double value = 1.0;
  Eigen::Vector2d by_x = Eigen::Vector2d::Zero();
  double by_log_blur = 0.0;
};

/// Returns the marker under a Gaussian blur of standard deviation s, along each of its axes:
///
///     W(x) = 1 - sum over black cells of P(x; x0, x1) P(y; y0, y1)                          (1)
///     P(x; x0, x1) = Phi((x - x0) / s) - Phi((x - x1) / s)                                  (2)
///
/// Cost     about 0.1 us
[[nodiscard]] White WhiteAt(const PrintedMarker& marker, const Eigen::Vector2d& at_mm,
                            const Eigen::Vector2d& blur_mm);

}  // namespace sateen
