#pragma once

#include "core/error.h"

namespace sateen {

// Limits of the checks of frames. Shares and changes are relative: 0.1 is 10 %.
struct FrameCheckOptions {
  // Largest share of a frame's pixels that may saturate. (0, 1]
  double max_saturated = 0.001;
  // Least brightness of a light that is on, relative to the calibration. (0, 1]
  double min_level = 0.3;
  // Largest change of a light's brightness relative to the calibration. (0, 1]
  double max_level_change = 0.12;
  // The same where the lights are not calibrated but only measured with a ruler. (0, 1]
  double max_rough_level_change = 0.5;
  // Share of its own light's misfit below which another light explains a frame. (0, 1]
  double other_light_misfit = 0.4;
  // Largest change from first to last dark frame, relative to the lit frames' brightness. (0, 1]
  double max_ambient = 0.01;
  // Drift of the first light above which there is a warning. (0, 1]
  double max_drift = 0.03;
  // Largest distance that the picture may move. (0, 100] px
  double max_shift_px = 1.0;
  // Correlation of first frame and repeat below which shifts are not found. (0, 1]
  double min_shift_peak = 0.1;
  // Least share of the light that a shadow takes to be found. (0, 1]
  double min_shade = 0.1;
  // Largest difference between a file's exposure time and the camera's setting. (0, 1]
  double max_exposure_error = 0.1;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

}  // namespace sateen
