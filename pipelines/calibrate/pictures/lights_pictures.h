#pragma once

#include <vector>

#include "pipelines/calibrate/calibrate_lights.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {

// Writes into `result.pictures`, one panel per light, the deviation of the first sheet from the
// light, in percent:
//   before.png     the rough light, with the flux that fits it best; white is 10 %
//   residuals.png  the fitted light; white is 1 %
[[nodiscard]] Status DrawLights(const std::vector<Sheet>& sheets, double albedo,
                                const LightsCalibration& result);

}  // namespace sateen
