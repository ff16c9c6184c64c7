#pragma once

#include "pipelines/calibrate/calibrate_check.h"

namespace sateen {

// Fills result.faults and result.notes from its other members.
void SayWhatIsWrong(const CalibrationCheckOptions& options, CalibrationCheck& result);

}  // namespace sateen
