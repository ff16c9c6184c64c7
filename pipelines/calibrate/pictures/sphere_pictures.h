#pragma once

#include "core/error.h"
#include "pipelines/calibrate/calibrate_spheres.h"

namespace sateen {

// Writes into result.pictures:
//   outlines.png  each sphere with its outline and every frame's highlight, numbered as in the
//                 table
//   polar.png     the lights as seen from above, the zenith in the middle
[[nodiscard]] Status DrawSpheres(const SpheresCalibration& result);

}  // namespace sateen
