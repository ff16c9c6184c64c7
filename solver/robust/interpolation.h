#pragma once

#include "core/task.h"
#include "solver/normal_field.h"
#include "solver/robust/rungs.h"

namespace sateen {

/// Adds the error that interpolated colours of camera RAW frames leave where normals bend from
/// pixel to pixel, which no residual shows:
///
///     uncertainty <- hypot(uncertainty, b / 2),
///     b^2 = |n(x-1) - 2 n(x) + n(x+1)|^2 + the same in y                                      (1)
///
/// The albedo's uncertainty takes its luminance, relative to the pixel's, for n. A neighbour that
/// is unsolved or beyond the border counts as differing by as much as the opposite one. `total`
/// receives the sums of the new uncertainties. kCancelled.
[[nodiscard]] Status DoubtInterpolation(const Task& task, NormalField& field, PieceSummary& total);

}  // namespace sateen
