#pragma once

#include "core/error.h"
#include "pipelines/calibrate/calibrate_response.h"

namespace sateen {

/// Draws into the folder result.pictures, whole or not at all:
/// linearity.svg         readings against what exposure times say, and how far they are off it
/// photon-transfer.svg   variance against mean, with the fitted line
/// patches.png           the frame in which the chart was found, green around what is read of each
///                       patch, red where that is left out under some light
[[nodiscard]] Status DrawResponse(const ResponseCalibration& result);

}  // namespace sateen
