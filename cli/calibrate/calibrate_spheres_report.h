#pragma once

#include <string>

#include "cli/calibrate/calibrate_spheres.h"

namespace sateen::cli {

[[nodiscard]] std::string TextReport(const CalibrateSpheresArgs& args,
                                     const SpheresCalibration& result);
// One JSON object, schema sateen.calibrate.spheres/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateSpheresArgs& args,
                                     const SpheresCalibration& result);

}  // namespace sateen::cli
