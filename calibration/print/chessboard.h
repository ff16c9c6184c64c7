#pragma once

#include "calibration/print/board_find.h"

namespace sateen {

// Finds a chessboard, as FindBoard() does.
[[nodiscard]] Result<BoardView> FindChessboard(const Image<uint8_t>& grey, const BoardSpec& spec);

}  // namespace sateen
