#include "calibration/fit/robust_spread.h"

#include <algorithm>
#include <cmath>

namespace sateen {
namespace {

constexpr double kOutlierScale = 4.0;  // times the residuals' spread

}  // namespace

double Rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value * value;
  }
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(values.size(), 1)));
}

double SpreadOf(const std::vector<double>& residuals) {
  std::vector<double> sizes(residuals.size());
  std::ranges::transform(residuals, sizes.begin(), [](double r) { return std::abs(r); });
  // A fit that no sample is near leaves nothing to measure.
  return sizes.empty() ? 1e-12 : std::max(kSdPerMad * Median(std::move(sizes)), 1e-12);
}

std::vector<size_t> OnModel(const std::vector<size_t>& indices,
                            const std::vector<double>& residuals, double spread) {
  const double limit = kOutlierScale * spread;
  std::vector<size_t> within;
  within.reserve(indices.size());
  for (size_t i = 0; i < indices.size(); ++i) {
    const double worst = std::max({std::abs(residuals[3 * i]), std::abs(residuals[3 * i + 1]),
                                   std::abs(residuals[3 * i + 2])});
    if (worst <= limit) {
      within.push_back(indices[i]);
    }
  }
  return within;
}

}  // namespace sateen
