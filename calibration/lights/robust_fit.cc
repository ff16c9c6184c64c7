#include "calibration/lights/robust_fit.h"

#include "calibration/fit/robust_spread.h"

namespace sateen {
namespace {

constexpr double kLossScale = 2.0;  // times the residuals' spread
constexpr int kRobustRounds = 4;

}  // namespace

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
    return Fail(
        ErrorCode::kDegenerate,
        "only {} of {} samples follow one light; need half: is this the light's frame, and does "
        "white paper fill the table?",
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
