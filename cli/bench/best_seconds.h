#pragma once

#include <functional>

#include "core/error.h"

namespace sateen::cli {

// Returns the seconds of the fastest of `repeats` runs, or the first error.
[[nodiscard]] Result<double> BestSeconds(int repeats, const std::function<Status()>& run);

}  // namespace sateen::cli
