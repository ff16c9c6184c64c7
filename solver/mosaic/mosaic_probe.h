#pragma once

#include "core/error.h"
#include "core/task.h"
#include "solver/mosaic/mosaic_rungs.h"

namespace sateen {

// Solves some rows before the others and sets the job's lobe, where the scene has one, and its
// doubt about rung 1. Fails with kIo where rows cannot be read, or with kCancelled.
[[nodiscard]] Status ProbeMosaic(MosaicJob& job, const Task& task);

}  // namespace sateen
