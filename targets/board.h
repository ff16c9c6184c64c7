#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

enum class BoardPattern {
  kChessboard,
  kCharuco  // a chessboard with a marker in every white square, so that a part of it is enough
};

/// A flat printed board. Its frame: millimetres, origin at the centre of the printed squares, x
/// right and y up as printed, z out of the paper.
///
/// Squares count from the top left one, which is black. Boards "legacy" are as OpenCV drew them
/// before 4.6: the bottom left square is black, so with an even number of rows the top left one is
/// white. Corners are where four squares meet, counted row by row from the top left as well.
struct BoardSpec {
  BoardPattern pattern = BoardPattern::kChessboard;
  int columns = 0;  // squares
  int rows = 0;     // squares
  double square_mm = 0.0;
  double marker_mm = 0.0;  // kCharuco: these three
  std::string dictionary = {};
  bool legacy = false;

  // Returns the text as ParseBoardSpec() reads it.
  [[nodiscard]] std::string Text() const;
  [[nodiscard]] int CornerCount() const { return (columns - 1) * (rows - 1); }
  [[nodiscard]] Eigen::Vector3d CornerPoint(int id) const;
  [[nodiscard]] bool IsBlack(int column, int row) const;
  // Centres of the white squares in the order of their markers' ids.
  [[nodiscard]] std::vector<Eigen::Vector3d> MarkerCenters() const;
  // Returns true if the board turned by half a turn looks the same: chessboards with an even number
  // of squares along both sides or an odd one along both.
  [[nodiscard]] bool IsSymmetric() const;
};

/// "chessboard:9x6:24mm"           inner corners, square
/// "charuco:10x7:25mm:18mm"        squares, square, marker
/// "charuco:10x7:25mm:18mm:DICT_5X5_250:legacy"   and, each optional, dictionary and old pattern
///
/// The dictionary is DICT_4X4_50, or the smallest of the same kind that has enough markers.
/// Errors   kInvalidArgument: another form; fewer than 3 x 3 squares or more than 100 x 100;
///          lengths that are not positive; a marker that does not fit its square; too small a
///          dictionary
[[nodiscard]] Result<BoardSpec> ParseBoardSpec(std::string_view text);

}  // namespace sateen
