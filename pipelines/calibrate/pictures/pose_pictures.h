#pragma once

#include "pipelines/calibrate/calibrate_pose.h"

namespace sateen {

// Writes into `result.pictures`: axes.png, the first photograph with the table's axes and a grid of
// 50 mm.
[[nodiscard]] Status DrawPose(const PoseCalibration& result, double thickness_mm);

}  // namespace sateen
