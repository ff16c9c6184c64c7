#include "scanner/checks/light_patterns.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "core/statistics.h"
#include "rig/projection.h"

namespace sateen {
namespace {

// Returns med_j log of (1), block by block, over the lights that are on.
BlockField MedianLog(const std::vector<BlockField>& all, const std::vector<bool>& on) {
  BlockField median;
  for (std::size_t b = 0; b < all[0].size(); ++b) {
    std::vector<double> logs;
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (on[k]) {
        logs.push_back(std::log(std::max(all[k][b], 1e-30)));
      }
    }
    median.push_back(logs.empty() ? 0.0 : Median(std::move(logs)));
  }
  return median;
}

// Returns (1); not finite where a value is not above 0.
BlockField PatternOf(BlockField field, const BlockField& median_log) {
  std::ranges::transform(field, median_log, field.begin(),
                         [](double value, double median) { return std::log(value) - median; });
  return field;
}

// Returns (2), over the blocks where both are known.
double Misfit(const BlockField& q, const BlockField& r) {
  double sum = 0.0;
  double sum2 = 0.0;
  double count = 0.0;
  for (std::size_t b = 0; b < q.size(); ++b) {
    const double difference = q[b] - r[b];
    if (std::isfinite(difference)) {
      sum += difference;
      sum2 += difference * difference;
      count += 1.0;
    }
  }
  return count > 0.0 ? sum2 / count - sum / count * (sum / count) : 0.0;
}

}  // namespace

Eigen::Vector3d LightAtPixel(const Rig& rig, const Light& light, const Eigen::Vector2d& px) {
  Eigen::Vector3d x_mm = Eigen::Vector3d::Zero();
  if (rig.camera && rig.camera->has_pose) {
    const std::optional<Eigen::Vector3d> seen = TablePointOfPixel(*rig.camera, px.x(), px.y());
    if (!seen) {
      return Eigen::Vector3d::Zero();
    }
    x_mm = *seen;
  }
  const Incident incident = IncidentAt(light, x_mm);
  return incident.e_rgb.sum() * incident.l;
}

LightPatterns::LightPatterns(const std::vector<BlockField>& signal,
                             std::vector<BlockField> predicted, const std::vector<bool>& on)
    : predicted_(std::move(predicted)), median_predicted_(MedianLog(predicted_, on)) {
  const BlockField median_signal = MedianLog(signal, on);
  for (const BlockField& field : signal) {
    frames_.push_back(PatternOf(field, median_signal));
  }
  for (const BlockField& field : predicted_) {
    lights_.push_back(PatternOf(field, median_predicted_));
  }
}

LightPatterns::Fit LightPatterns::FitOf(std::size_t k) const {
  const double own = Misfit(frames_[k], lights_[k]);
  Fit fit{.own = own, .least = own, .best = k};
  for (std::size_t j = 0; j < lights_.size(); ++j) {
    const double misfit = Misfit(frames_[k], lights_[j]);
    if (misfit < fit.least) {
      fit.best = j;
      fit.least = misfit;
    }
  }
  return fit;
}

std::optional<std::size_t> LightPatterns::SecondLight(std::size_t k) const {
  std::optional<std::size_t> best;
  double least = 0.0;
  for (std::size_t j = 0; j < predicted_.size(); ++j) {
    BlockField both = predicted_[k];
    std::ranges::transform(both, predicted_[j], both.begin(), std::plus<>());
    const double misfit = Misfit(frames_[k], PatternOf(both, median_predicted_));
    if (j != k && (!best || misfit < least)) {
      best = j;
      least = misfit;
    }
  }
  return best;
}

}  // namespace sateen
