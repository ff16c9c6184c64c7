#pragma once

#include <string>

#include "cli/calibrate/calibrate_lens.h"

namespace sateen::cli {

// One JSON object, schema sateen.calibrate.lens/1, on one line (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateLensArgs& args, const LensCalibration& result);

// The same for a person.
[[nodiscard]] std::string TextReport(const CalibrateLensArgs& args, const LensCalibration& result);

}  // namespace sateen::cli
