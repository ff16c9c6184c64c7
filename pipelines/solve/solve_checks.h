#pragma once

#include "core/error.h"
#include "pipelines/solve/solve.h"

namespace sateen {

// Returns whether the backend solves mosaics; the others exist for comparison on colours.
[[nodiscard]] bool SolvesMosaics(Backend backend);

// Fails where the capture lacks what an option needs, or cannot be solved yet.
[[nodiscard]] Status CheckSupported(const SolveOptions& options, const Dataset& dataset);

}  // namespace sateen
