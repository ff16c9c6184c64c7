#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "core/error.h"

namespace sateen {

// Numbers with units, as people type and read them.

// Reads "50%" or "0.5" as 0.5. kInvalidArgument: anything else, or not in 0 to 1.
[[nodiscard]] Result<double> ParseLevel(std::string_view text);

// Reads "500ms", "2s" or "1.5s", to the millisecond. kInvalidArgument: anything else, or not from
// 1 ms to one hour.
[[nodiscard]] Result<std::chrono::milliseconds> ParseDuration(std::string_view text);

// Reads "1/50", "20ms", "0.5s" or "0.02", in seconds. kInvalidArgument: anything else, or not in
// 10 us to 60 s.
[[nodiscard]] Result<double> ParseExposure(std::string_view text);
// Returns "1/50 s" below a third of a second, else "0.5 s".
[[nodiscard]] std::string ExposureText(double exposure_s);

// Returns "500 ms" below a second, else "2 s" or "1.25 s".
[[nodiscard]] std::string DurationText(std::chrono::milliseconds time);
// Returns "50 %" or "12.5 %".
[[nodiscard]] std::string LevelText(double level);

}  // namespace sateen
