#pragma once

#include <functional>

#include "calibration/sheet/sheet_readings.h"
#include "rig/light.h"

namespace sateen {

// How a sheet lies and what is on it.
struct SheetSurface {
  // Against where it was said to lie, where that explains it: steepest slope over the field, and
  // highest place.
  double slope_deg = 0.0;
  double height_mm = 0.0;
  // Shares of the blocks: darker or brighter than paper under all lights (spots, no paper);
  // bright on the side of the lights (folds, edges).
  double spots = 0.0;
  double folds = 0.0;
  double steepest_deg = 0.0;  // of the folds
  bool is_off = false;        // beyond what the check allows
};

/// Albedo and slope of each block of a sheet from all lights, what a change already explains taken off:
///
///     i_jk / m_jk - 1 = a_j - (p_j l_u + q_j l_v) / l_n + noise,       k = 1..K               (1)
///
/// in least squares over the lights with a sample there, at least four; m what is expected in
/// green, 0 for a light that takes no part; l towards light k in the sheet's frame. A spot has |a_j| above 2 %, a fold a slope above
/// 0.5 degrees, both above five standard deviations, from what (1) leaves over the whole sheet.
///
/// height, slope, is_off are left to the caller. Nothing is found with fewer than four lights.
using ExpectedGreen = std::function<double(size_t light, const SheetSample& sample)>;
[[nodiscard]] SheetSurface SurfaceOf(const SheetReadings& sheet, const Lights& lights,
                                     const ExpectedGreen& expected);

}  // namespace sateen
