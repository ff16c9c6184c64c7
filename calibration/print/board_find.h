#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"
#include "targets/board.h"

namespace sateen {

// Corners of one board in one picture.
struct BoardView {
  ImageSize size_px;
  std::vector<int> ids = {};
  std::vector<Eigen::Vector2d> corners_px = {};  // pixel centres at integers
  std::vector<Eigen::Vector3d> points_mm = {};   // the same corners in the board frame; z = 0
  std::string name = {};                         // of the picture, for messages; may be empty
  double edge_px = 0.0;                          // EdgeWidthPx(); 0: not known
};

/// Finds the board in the picture, each corner to some hundredths of a pixel.
///
/// A chessboard is found whole or not at all, and which end is its top left is read from the
/// colours of its squares; if IsSymmetric(), it may be turned by half a turn. Of a ChArUco board
/// a part is enough.
///
/// Errors   kDegenerate: no such board; another board: of a chessboard, one with more corners, of a
///          ChArUco board, one whose markers lie elsewhere; fewer than 6 corners or all in one row
/// Cost     about 0.1 s a megapixel
[[nodiscard]] Result<BoardView> FindBoard(const Image<uint8_t>& grey, const BoardSpec& spec);

}  // namespace sateen
