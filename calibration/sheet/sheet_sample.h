#pragma once

#include <Eigen/Core>
#include <vector>

namespace sateen {

// White paper under one light: the mean over one block of pixels.
struct SheetSample {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  // on the sheet, in the table frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // of the sheet, likewise
  Eigen::Vector3d radiance_rgb = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd_rgb =
      Eigen::Vector3d::Ones();  // standard deviation of that mean, up to a factor
};

// The largest standard deviation [rad] of the direction from the samples to a light whose position has
// this covariance [mm^2].
[[nodiscard]] double WorstDirectionSd(const std::vector<SheetSample>& samples,
                                      const Eigen::Vector3d& position_mm,
                                      const Eigen::Matrix3d& covariance);

// Why a light has no samples.
enum class FrameFault { kNone, kDark, kSaturated };

}  // namespace sateen
