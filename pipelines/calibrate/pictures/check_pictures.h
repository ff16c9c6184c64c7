#pragma once

#include "imaging/show/pictures.h"
#include "pipelines/calibrate/calibrate_check.h"

namespace sateen {

// Draws one panel per light, in the rig's order, five in a row: today's paper over what the rig
// says, without what all lights have in common. Light grey: as expected; blue: 2 % darker; red: 2 %
// brighter; dark grey: no sample.
[[nodiscard]] Rgb8 RatioPicture(const CalibrationCheck& result, size_t sheet,
                                const SheetReadings& view);

}  // namespace sateen
