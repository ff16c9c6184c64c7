#pragma once

#include <functional>

#include "calibration/sheet/sheet_readings.h"
#include "rig/light.h"

namespace sateen {

// How a sheet lies, and its spots and folds.
struct SheetSurface {
  // Largest slope and height against where the sheet was said to lie.
  double slope_deg = 0.0;
  double height_mm = 0.0;
  // Shares of the blocks: darker or brighter than paper under all lights (spots, no paper); bright
  // towards the lights (folds, edges).
  double spots = 0.0;
  double folds = 0.0;
  double steepest_deg = 0.0;  // largest slope of the folds
  bool is_off = false;        // true: beyond the limits of the check
};

// Returns the green radiance of a sample that the change predicts; 0 for a light without a part.
using ExpectedGreen = std::function<double(size_t light, const SheetSample& sample)>;

/// Finds spots and folds: fits albedo a_j and slope (p_j, q_j) of each block j to all lights k,
///
///     i_jk / m_jk - 1 = a_j - (p_j l_u + q_j l_v) / l_n + noise,       k = 1..K               (1)
///
/// by least squares over at least four lights with a sample there. m is the expected green
/// radiance, l the direction of light k in the sheet's frame. A spot has |a_j| above 2 %, a fold a
/// slope above 0.5 degrees, both above five standard deviations. The noise is that of the residuals
/// of (1) over the whole sheet. Nothing is found with fewer than four lights.
///
/// Returns  spots, folds and steepest_deg; the caller fills in the other fields
[[nodiscard]] SheetSurface SurfaceOf(const SheetReadings& sheet, const Lights& lights,
                                     const ExpectedGreen& expected);

}  // namespace sateen
