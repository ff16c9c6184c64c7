#pragma once

#include "calibration/print/board_find.h"

namespace sateen {

// FindBoard() of a chessboard.
[[nodiscard]] Result<BoardView> FindChessboard(const Image<uint8_t>& grey, const BoardSpec& spec);

}  // namespace sateen
