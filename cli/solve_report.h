#pragma once

#include <string>

#include "pipelines/solve/solve.h"

namespace sateen::cli {

// Returns what `sateen solve` prints without --json: a few lines, the last without its end.
[[nodiscard]] std::string TextReport(const SolveOptions& options, const SolveOutcome& outcome);

}  // namespace sateen::cli
