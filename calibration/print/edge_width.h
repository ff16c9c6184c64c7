#pragma once

#include "calibration/print/board_find.h"

namespace sateen {

/// Measures how blurred the print's edges are: returns the standard deviation [px] of the Gaussian
/// that would blur a step as much,
///
///     sigma = contrast / (sqrt(2 pi) steepest slope)                                          (1)
///
/// as the median over the edges between neighbouring corners of a row. A sharp picture has about
/// 0.5. The result is at most some 0.8 of the free width on both sides of an edge: a third of a
/// square, or the gap around a ChArUco marker. It is 0 where that width is below 2 px.
[[nodiscard]] double EdgeWidthPx(const Image<uint8_t>& grey, const BoardSpec& spec,
                                 const BoardView& view);

}  // namespace sateen
