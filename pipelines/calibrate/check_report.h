#pragma once

#include <string>

#include "pipelines/calibrate/calibrate_check.h"

namespace sateen {

// Returns the text of check.json, schema sateen.calibrate.check/1 (docs/formats.md), on one line.
[[nodiscard]] std::string CheckToJson(const CalibrationCheckOptions& options,
                                      const CalibrationCheck& result);

}  // namespace sateen
