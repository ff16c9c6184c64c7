#include "calibration/check/change_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sateen {
namespace {

constexpr double kPerParameter = 15.0;  // fall of chi2 that a free unknown must earn
constexpr double kAlsoMoved = 0.3;      // share of the largest gain

// Frees the lights whose change earns most. Returns false where none earns its unknowns.
bool AddChanges(const std::vector<ChangeGain>& gains, ChangeMask& mask) {
  const auto earned = [&](size_t k) {
    const double moved = mask.moved[k] ? 0.0 : gains[k].moved - 3.0 * kPerParameter;
    const double turned = mask.turned[k] ? 0.0 : gains[k].turned - 2.0 * kPerParameter;
    return std::pair{moved, turned};
  };
  double most = 0.0;
  for (size_t k = 0; k < gains.size(); ++k) {
    most = std::max({most, earned(k).first, earned(k).second});
  }
  if (most <= 0.0) {
    return false;
  }
  for (size_t k = 0; k < gains.size(); ++k) {
    const auto [moved, turned] = earned(k);
    if (std::max(moved, turned) > kAlsoMoved * most) {
      (moved >= turned ? mask.moved : mask.turned)[k] = true;
    }
  }
  return true;
}

}  // namespace

Result<ChangeChoice> ChooseChange(const CheckModel& model, const SampleWeights& weights,
                                  const Task& task) {
  const size_t lights = model.LightCount();
  ChangeChoice best;
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [camera, lie] :
       {std::pair{false, false}, {true, false}, {false, true}, {true, true}}) {
    ChangeMask mask{.moved = std::vector<bool>(lights),
                    .turned = std::vector<bool>(lights),
                    .camera = camera,
                    .sheets = lie};
    ChangeFit fit = FitChange(model, weights, mask, model.Unchanged(), task);
    while (AddChanges(GainsOf(model, weights, fit, task), mask)) {
      fit = FitChange(model, weights, mask, fit.change, task);
      if (Status status = task.CheckCancelled(); !status) {
        return tl::unexpected(status.error());
      }
    }
    const double cost = fit.chi2 + kPerParameter * mask.Parameters(model.Sheets().size());
    if (cost < least) {
      least = cost;
      best = {std::move(mask), std::move(fit)};
    }
  }
  if (Status status = task.CheckCancelled(); !status) {
    return tl::unexpected(status.error());
  }
  if (!std::isfinite(least)) {
    return Fail(ErrorCode::kDegenerate,
                "no explanation of the sheets has a finite misfit; need readings with noise, as a "
                "camera's");
  }
  return best;
}

}  // namespace sateen
