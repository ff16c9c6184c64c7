#pragma once

#include "core/error.h"
#include "core/files/output_folder.h"
#include "core/task.h"
#include "pipelines/solve/solve.h"

namespace sateen {

// Stages all maps of a solve that is held whole, in the pixels of outcome.maps.camera.
[[nodiscard]] Status StageWhole(const SolveOptions& options, const SolveOutcome& outcome,
                                const Task& task, OutputFolder& folder);

// Stages height.exr of a solve with relief; without, the file goes from the folder.
[[nodiscard]] Status StageHeight(const SolveOptions& options, const SolveOutcome& outcome,
                                 const Task& task, OutputFolder& folder);

}  // namespace sateen
