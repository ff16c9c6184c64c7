#pragma once

#include <string>

#include "cli/calibrate/calibrate_lights.h"

namespace sateen::cli {

// Schema sateen.calibrate.lights/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateLightsArgs& args,
                                     const LightsCalibration& result);
[[nodiscard]] std::string TextReport(const CalibrateLightsArgs& args,
                                     const LightsCalibration& result);

}  // namespace sateen::cli
