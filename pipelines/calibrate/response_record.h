#pragma once

#include "pipelines/calibrate/calibrate_response.h"

namespace sateen {

// Returns the record of a finished calibration, with the bins of linearity.
[[nodiscard]] ResponseRecord RecordOf(const ResponseCalibration& result);

// Returns the record as a rig holds it: the bins, which only a picture needs, are left out.
[[nodiscard]] ResponseRecord WithoutBins(ResponseRecord record);

}  // namespace sateen
