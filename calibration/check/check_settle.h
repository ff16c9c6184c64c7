#pragma once

#include <cstddef>
#include <vector>

#include "calibration/check/check_model.h"
#include "calibration/check/rig_change.h"
#include "core/task.h"

namespace sateen {

// Weights of samples: 1 over the variance of a residual of equation (1) of check_model.h, or 0.
using SheetWeights = std::vector<std::vector<double>>;  // of one light, [sheet][sample]
using SampleWeights = std::vector<SheetWeights>;        // [light]; empty: takes no part

// One light as its own readings have it.
struct SettledLight {
  LightChange change;
  SheetWeights weights;
};

/// Fits one light alone, robustly, with whatever change it needs, so that its noise can be told
/// from what changed. Eight steps of Gauss and Newton's method with Cauchy's weights, twice as wide
/// as the residuals then are, and the priors of check_unknowns.h. Samples further off than four
/// robust standard deviations get no weight: dust and folds. The others get the reciprocal of
///
///     spread^2 max(1, V_6 / V_1)                                                             (1)
///
/// V_6 is 36 times the variance of the means of squares of 6 x 6 blocks, V_1 that of single
/// blocks: their ratio is above 1 where the residuals of neighbours are correlated.
[[nodiscard]] SettledLight SettleLight(const CheckModel& model, size_t light);

/// Returns the weights of all lights that take part: used[k].
[[nodiscard]] SampleWeights SettledWeights(const CheckModel& model, const std::vector<bool>& used,
                                           const Task& task);

}  // namespace sateen
