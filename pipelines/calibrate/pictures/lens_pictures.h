#pragma once

#include "pipelines/calibrate/calibrate_lens.h"

namespace sateen {

// Writes into `result.pictures`, and fills in `result.line_deviation`:
//   coverage.png     every corner used, on the image, whose empty parts are red
//   residuals.png    each corner's distance from where the lens puts it, enlarged
//   undistorted.png  the view whose rows are least straight, as photographed and without
//                    distortion, with straight lines through its outermost corners
[[nodiscard]] Status DrawLens(LensCalibration& result);

}  // namespace sateen
