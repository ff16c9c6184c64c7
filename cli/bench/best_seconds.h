#pragma once

#include <functional>

#include "core/error.h"

namespace sateen::cli {

// Seconds of the fastest of `repeats` runs; the first error of one.
[[nodiscard]] Result<double> BestSeconds(int repeats, const std::function<Status()>& run);

}  // namespace sateen::cli
