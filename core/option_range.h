#pragma once

#include <string_view>

#include "core/error.h"

namespace sateen {

// Returns the error of an option that is out of its range, kInvalidArgument:
// "shadow_level = 2; need 0 <= shadow_level < 1". `range` says what is needed, in words or symbols.
[[nodiscard]] tl::unexpected<Error> OutOfRange(std::string_view name, double value,
                                               std::string_view range);

// Fails as OutOfRange does, "alpha = -1; need 0.001 to 1", unless min <= value <= max. NaN fails.
[[nodiscard]] Status CheckRange(std::string_view name, double value, double min, double max);

}  // namespace sateen
