#pragma once

#include <Eigen/Core>

namespace sateen {

// White paper under one light: the mean over one block of pixels.
struct SheetSample {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  // on the sheet, in the table frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // of the sheet, likewise
  Eigen::Vector3d radiance_rgb = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd_rgb =
      Eigen::Vector3d::Ones();  // standard deviation of that mean, up to a factor
};

// Why a light has no samples.
enum class FrameFault { kNone, kDark, kSaturated };

}  // namespace sateen
