#pragma once

#include <string>

#include "cli/calibrate/calibrate_check.h"
#include "imaging/show/pictures.h"

namespace sateen::cli {

// Fills `faults` and `notes` from the rest.
void SayWhatIsWrong(const CalibrateCheckArgs& args, CalibrationCheck& result);

// Schema sateen.calibrate.check/1 (docs/formats.md).
[[nodiscard]] std::string JsonReport(const CalibrateCheckArgs& args,
                                     const CalibrationCheck& result);
[[nodiscard]] std::string TextReport(const CalibrateCheckArgs& args,
                                     const CalibrationCheck& result);

// One panel a light, in the rig's order, five in a row: today's paper over what the rig says, what
// all lights have in common taken off. Light grey as expected, blue 2 % darker, red 2 % brighter, dark
// grey where there is nothing.
[[nodiscard]] Rgb8 RatioPicture(const CalibrationCheck& result, size_t sheet,
                                const SheetReadings& view);

}  // namespace sateen::cli
