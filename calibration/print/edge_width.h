#pragma once

#include "calibration/print/board_find.h"

namespace sateen {

/// How blurred the print's edges are: standard deviation, in pixels, of the Gaussian that would
/// blur a step as much; median over the edges between corners that are neighbours in a row.
///
///     sigma = contrast / (sqrt(2 pi) steepest slope)                                          (1)
///
/// About 0.5 in a sharp picture. Capped at some 0.8 of what is free on both sides of an edge: a
/// third of a square, of a ChArUco board the gap around a marker. 0 where that is below 2 px.
[[nodiscard]] double EdgeWidthPx(const Image<uint8_t>& grey, const BoardSpec& spec,
                                 const BoardView& view);

}  // namespace sateen
