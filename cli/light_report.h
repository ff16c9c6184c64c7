#pragma once

#include <string>

#include "scanner/devices/light_board.h"

namespace sateen::cli {

// What `sateen light status` and `sateen light limits` print, as text and with --json
// (docs/formats.md).
[[nodiscard]] std::string StatusText(const std::string& port, const BoardInfo& info,
                                     const BoardReport& report);
[[nodiscard]] std::string StatusJson(const std::string& port, const BoardInfo& info,
                                     const BoardReport& report);
[[nodiscard]] std::string LimitsText(const BoardInfo& info);

// "16kHz", "2kHz", "250Hz": of BoardSettings::dim_clock.
[[nodiscard]] std::string DimClockText(int dim_clock);

}  // namespace sateen::cli
