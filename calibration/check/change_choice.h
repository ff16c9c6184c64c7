#pragma once

#include "calibration/check/check_system.h"
#include "core/error.h"
#include "core/task.h"

namespace sateen {

struct ChangeChoice {
  ChangeMask mask;
  ChangeFit fit;
};

/// The change that explains the sheets best: of all combinations of a camera that moved and sheets
/// that lie elsewhere, each with as many lights that moved or turned as earn it, the one with the
/// least chi2 + 15 per parameter. Errors: kCancelled.
[[nodiscard]] Result<ChangeChoice> ChooseChange(const CheckSystem& system, size_t lights,
                                                size_t sheets, const Task& task);

}  // namespace sateen
