#pragma once

#include "core/error.h"
#include "core/task.h"
#include "solver/lambertian.h"
#include "solver/solve_input.h"

namespace sateen {

// Gain at which every normal is uncertain by 180 degrees.
inline constexpr double kUnknownGain = 1e12;

/// Measures a gain, in DN, on 32 rows of a stack whose noise is not known. The variance of a
/// reading is taken as gain signal + 1/12, the latter from rounding, with signal = reading - black.
///
///     gain = min(gain_residuals, gain_neighbours)                                             (1)
///     gain_residuals  = q_5(misfit at a gain of 1) / q_5(chi^2 / (usable - 3))                (2)
///     gain_neighbours = q_25(b^2 / 6 signal) / q_25(chi^2_1),
///     b = r(x - 2) - 2 r(x) + r(x + 2)                                                        (3)
///
/// q_s is the quantile of s %. (2) is too large where the scene shines everywhere, (3) where it has
/// texture. Where a quarter of the b, which are whole numbers, are 0, (3) is the mean of (b^2 -
/// 6/12) / 6 signal, or 0.
///
/// Returns  kUnknownGain where no site of these rows shows the noise: none is solved, or all have
///          three lights and no neighbours
/// Errors   as SolveMosaic
[[nodiscard]] Result<double> MeasureGain(const MosaicInput& input, const LambertianOptions& options,
                                         const Task& task);

}  // namespace sateen
