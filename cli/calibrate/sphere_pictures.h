#pragma once

#include "cli/calibrate/calibrate_spheres.h"
#include "core/error.h"

namespace sateen::cli {

// Writes into result.pictures: outlines.png, each sphere with its outline and every frame's highlight,
// numbered as in the table; polar.png, the lights as seen from above, the zenith in the middle.
[[nodiscard]] Status DrawSpheres(const SpheresCalibration& result);

}  // namespace sateen::cli
