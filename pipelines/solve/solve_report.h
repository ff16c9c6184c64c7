#pragma once

#include <string>

#include "pipelines/solve/solve.h"

namespace sateen {

// Returns the text of solve.json: one JSON object of schema sateen.solve/1 (docs/formats.md).
[[nodiscard]] std::string SolveReportJson(const SolveOptions& options, const SolveOutcome& outcome);

}  // namespace sateen
