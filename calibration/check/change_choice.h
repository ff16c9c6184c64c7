#pragma once

#include "calibration/check/check_fit.h"
#include "calibration/check/check_model.h"
#include "calibration/check/rig_change.h"
#include "core/error.h"
#include "core/task.h"

namespace sateen {

// Change that was chosen.
struct ChangeChoice {
  ChangeMask mask;
  ChangeFit fit;
};

/// Chooses the change that explains the sheets best: the one with the least chi2 + 15 per free
/// unknown among
///
///     nothing; the camera moved; the sheets lie elsewhere; both
///
/// each with as many lights moved or turned as earn their unknowns, added by their gain.
///
/// Errors   kCancelled
///          kDegenerate: no explanation has a finite chi2
/// Cost     four fits and one more per round of lights added
[[nodiscard]] Result<ChangeChoice> ChooseChange(const CheckModel& model,
                                                const SampleWeights& weights, const Task& task);

}  // namespace sateen
