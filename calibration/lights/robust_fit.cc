#include "calibration/lights/robust_fit.h"

#include <algorithm>
#include <cmath>

namespace sateen {
namespace {

constexpr double kLossScale = 2.0;  // of the residuals' spread
constexpr int kRobustRounds = 4;
constexpr double kOutlierScale = 4.0;  // of the residuals' own spread
constexpr double kNormalMad = 1.4826;  // standard deviation over median of sizes

}  // namespace

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

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
  return std::max(kNormalMad * Median(std::move(sizes)), 1e-12);
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

Result<RobustFit> FitRobustly(const LightResiduals& residuals, LightModel model, const Light& start,
                              const std::vector<size_t>& indices, bool with_covariance) {
  RobustFit fit{.light = start};
  for (int round = 0; round < kRobustRounds; ++round) {
    const double spread = SpreadOf(residuals.Of(fit.light, indices));
    const Result<LightDescent> step =
        residuals.Descend(model, fit.light, indices, kLossScale * spread);
    if (!step) {
      return tl::unexpected(step.error());
    }
    fit.light = step->light;
    fit.iterations += step->iterations;
  }
  const std::vector<double> off = residuals.Of(fit.light, indices);
  fit.used = OnModel(indices, off, SpreadOf(off));
  if (2 * fit.used.size() < indices.size()) {
    return Fail(ErrorCode::kDegenerate,
                "only {} of {} samples follow one light; need half: is it this light, and white "
                "paper that fills the table?",
                fit.used.size(), indices.size());
  }
  Result<LightDescent> last = residuals.Descend(model, fit.light, fit.used, 0.0, with_covariance);
  if (!last) {
    return tl::unexpected(last.error());
  }
  fit.light = last->light;
  fit.iterations += last->iterations;
  fit.covariance = std::move(last->covariance);
  return fit;
}

}  // namespace sateen
