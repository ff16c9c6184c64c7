#include "calibration/sheet/sheet_sample.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/linear_algebra.h"

namespace sateen {

double WorstDirectionSd(const std::vector<SheetSample>& samples, const Eigen::Vector3d& position_mm,
                        const Eigen::Matrix3d& covariance) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d d = position_mm - sample.point_mm;
    const Eigen::Vector3d l = d.normalized();
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - l * l.transpose()) / d.norm();
    const Eigen::Matrix3d spread = across * covariance * across.transpose();
    worst = std::max(worst, SymmetricEigenvalues(spread)[2]);
  }
  return std::sqrt(worst);
}

}  // namespace sateen
