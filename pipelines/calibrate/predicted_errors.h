#pragma once

#include <Eigen/Core>

#include "core/error.h"
#include "core/task.h"

namespace sateen {

struct PredictedErrorOptions {
  int rigs = 100;    // at least 10
  int columns = 48;  // blocks of a frame
  int rows = 32;
  int tilts = 4;         // beside the flat sheet; 0: it alone
  double off_mm = 15.0;  // of the rough position, in a random direction
  uint64_t seed = 1;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Root mean square, over the rigs, of actual errors over the standard deviations that the fit gave
// them: 1 where those are right.
struct ErrorRatios {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // along x, y, z
  Eigen::Vector3d flux = Eigen::Vector3d::Zero();      // red, green, blue
  // Worst direction error over the field. The fit's standard deviation is along the worst of two
  // axes at the worst place, so that up to sqrt 2 is right.
  double direction = 0.0;
  int rigs = 0;
};

/// Compares the errors of FitLight() with their standard deviations on random rigs: the camera's
/// size (0.3 to 16 megapixels), height, field and full well; the light's place on the hemisphere (25 to
/// 60 degrees from the zenith, 450 to 750 mm), flux and colour; the tilts' slopes (5 to 15 degrees)
/// and directions.
///
/// Errors  kInvalidArgument: an option out of range; those of FitLight(); kCancelled
[[nodiscard]] Result<ErrorRatios> PredictedErrors(const PredictedErrorOptions& options = {},
                                                  const Task& task = {});

}  // namespace sateen
