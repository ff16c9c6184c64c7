#include "scanner/checks/gloss_shift.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/statistics.h"

namespace sateen {

void TakeOutGloss(const std::vector<Eigen::Vector2d>& l, std::vector<Shift>& shifts) {
  constexpr int kSteps = 30;
  constexpr double kLeastPx = 0.005;
  const size_t count = shifts.size();
  Eigen::Matrix2d b = Eigen::Matrix2d::Zero();
  std::vector<double> left(count - 1);
  for (int step = 0; step < kSteps; ++step) {  // (1), reweighted least squares
    Eigen::Matrix2d ll = 1e-9 * Eigen::Matrix2d::Identity();
    Eigen::Matrix2d dl = Eigen::Matrix2d::Zero();
    for (size_t k = 1; k < count; ++k) {
      const Eigen::Vector2d of_light = l[k] - l[k - 1];
      const Eigen::Vector2d jump = shifts[k].px - shifts[k - 1].px;
      left[k - 1] = (jump - b * of_light).norm();
      const double w = 1.0 / std::max(left[k - 1], kLeastPx);
      ll += w * of_light * of_light.transpose();
      dl += w * jump * of_light.transpose();
    }
    b = dl * ll.inverse();
  }
  const double typical = Median(left);
  for (size_t k = 1; k < count; ++k) {
    shifts[k].px -= b * l[k];
    // The last frame has the first light again, so that gloss does not move it.
    shifts[k].sd_px = std::hypot(shifts[k].sd_px, k + 1 < count ? typical : 0.0);  // (2)
  }
}

}  // namespace sateen
