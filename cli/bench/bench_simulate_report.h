#pragma once

#include <string>

#include "cli/bench/bench_simulate.h"

namespace sateen::cli {

// Schema sateen.bench.simulate/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const SimulateBenchReport& report);
[[nodiscard]] std::string TextReport(const SimulateBenchReport& report);

}  // namespace sateen::cli
