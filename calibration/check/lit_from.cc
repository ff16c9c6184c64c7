#include "calibration/check/lit_from.h"

#include <cmath>
#include <limits>

#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kMuchBetter = 0.5;  // times the unevenness by its own light

// Returns the median deviation of today's readings over those predicted for a light, after a common
// factor: the lower, the better the pattern fits.
double Unevenness(const std::vector<SheetSample>& samples, const Light& light) {
  std::vector<double> ratios;
  ratios.reserve(samples.size());
  for (const SheetSample& sample : samples) {
    const Incident in = IncidentAt(light, sample.point_mm);
    const double expected = in.e_rgb[1] * sample.normal.dot(in.l);
    if (expected > 0.0) {
      ratios.push_back(sample.radiance_rgb[1] / expected);
    }
  }
  if (2 * ratios.size() < samples.size() || ratios.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  const double median = Median(ratios);
  for (double& ratio : ratios) {
    ratio = std::abs(ratio / median - 1.0);
  }
  return Median(std::move(ratios));
}

}  // namespace

std::optional<size_t> LitFrom(const Lights& lights, const std::vector<SheetSample>& samples,
                              size_t k) {
  const double own = Unevenness(samples, lights[k]);
  double least = std::numeric_limits<double>::infinity();
  size_t best = k;
  for (size_t other = 0; other < lights.size(); ++other) {
    const double misfit = Unevenness(samples, lights[other]);
    if (misfit < least) {
      least = misfit;
      best = other;
    }
  }
  return best != k && least < kMuchBetter * own ? std::optional(best) : std::nullopt;
}

}  // namespace sateen
