#pragma once

#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "imaging/mosaic_stack.h"
#include "rig/rig.h"
#include "solver/lambertian.h"

namespace sateen {

// So large that every normal is uncertain by 180 degrees.
inline constexpr double kUnknownGain = 1e12;

/// A gain for a stack whose noise is not known, from what 32 rows of it tell: variance of a reading =
/// gain signal + 1/12, the last of rounding, signal = reading - black. [DN]
///
///     gain = min(gain_residuals, gain_neighbours)                                             (1)
///     gain_residuals  = q_5(misfit at a gain of 1) / q_5(chi^2 / (usable - 3))                (2)
///     gain_neighbours = q_25(b^2 / 6 signal) / q_25(chi^2_1),  b = r(x - 2) - 2 r(x) + r(x + 2)  (3)
///
/// q_s are quantiles. (2) is too large where the scene shines everywhere, (3) where it has texture. Where a
/// quarter of the b are 0, which are whole numbers, (3) is the mean of (b^2 - 6/12) / 6 signal, or 0.
///
/// Returns  kUnknownGain where no site of these rows tells: none is solved, or three lights and no runs
/// Errors   as SolveMosaic
[[nodiscard]] Result<double> MeasureGain(const MosaicStack& stack, const Rig& rig,
                                         const std::optional<Mask>& mask,
                                         const LambertianOptions& options, const Task& task);

}  // namespace sateen
