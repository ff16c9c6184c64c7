#pragma once

#include <string>

#include "cli/calibrate/calibrate_response.h"

namespace sateen::cli {

// Schema sateen.calibrate.response/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateResponseArgs& args,
                                     const ResponseCalibration& result);
[[nodiscard]] std::string TextReport(const CalibrateResponseArgs& args,
                                     const ResponseCalibration& result);

}  // namespace sateen::cli
