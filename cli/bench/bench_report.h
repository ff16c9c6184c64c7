#pragma once

#include <string>

#include "cli/bench/bench_solve.h"

namespace sateen::cli {

// Schema sateen.bench.solve/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const BenchReport& report);
[[nodiscard]] std::string TextReport(const BenchReport& report);
// Plots time per pixel against mean angular error, both logarithmic, on all threads; lower left is
// better.
[[nodiscard]] std::string SvgPlot(const BenchReport& report);

}  // namespace sateen::cli
