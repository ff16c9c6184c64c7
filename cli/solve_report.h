#pragma once

#include <string>

#include "cli/solve.h"

namespace sateen::cli {

// Schema sateen.solve/1 (docs/formats.md): one object; also what solve.json holds.
[[nodiscard]] std::string JsonReport(const SolveArgs& args, const SolveOutcome& outcome);
[[nodiscard]] std::string TextReport(const SolveArgs& args, const SolveOutcome& outcome);

}  // namespace sateen::cli
