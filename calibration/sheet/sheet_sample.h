#pragma once

#include <Eigen/Core>
#include <vector>

namespace sateen {

// Mean over one block of pixels of white paper under one light.
struct SheetSample {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  // on the sheet, in the table frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // normal of the sheet, table frame
  Eigen::Vector3d radiance_rgb = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd_rgb = Eigen::Vector3d::Ones();  // its standard deviation, up to a factor
};

// Returns the largest standard deviation [rad], over the samples, of the direction to a light whose
// position has this covariance [mm^2].
[[nodiscard]] double WorstDirectionSd(const std::vector<SheetSample>& samples,
                                      const Eigen::Vector3d& position_mm,
                                      const Eigen::Matrix3d& covariance);

// Reason why a light has no samples.
enum class FrameFault { kNone, kDark, kSaturated };

}  // namespace sateen
