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
  std::string name = {};                         // name of the picture, for messages; may be empty
  double edge_px = 0.0;                          // width of its edges, EdgeWidthPx(); 0: not known
};

/// Finds the board in the picture, each corner to some hundredths of a pixel.
///
/// A chessboard must be seen whole. Its top left corner is told by the colours of its squares; if
/// IsSymmetric(), the result may be turned by half a turn. A part of a ChArUco board is enough.
///
/// Errors   kDegenerate: no such board; a chessboard with more corners; a ChArUco board whose
///          markers lie elsewhere; fewer than 6 corners or all in one row
/// Cost     about 0.1 s per megapixel
[[nodiscard]] Result<BoardView> FindBoard(const Image<uint8_t>& grey, const BoardSpec& spec);

}  // namespace sateen
