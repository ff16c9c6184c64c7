#pragma once

#include "cli/calibrate/calibrate_lens.h"

namespace sateen::cli {

// Writes into `result.pictures`, and fills in `result.line_deviation`:
//   coverage.png     every corner used, on the image, whose empty parts are red
//   residuals.png    how far each corner is from where the lens puts it, enlarged
//   undistorted.png  the view whose rows are least straight, as photographed and without distortion, with
//                    straight lines through its outermost corners
[[nodiscard]] Status DrawLens(LensCalibration& result);

}  // namespace sateen::cli
