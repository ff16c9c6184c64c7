#pragma once

#include <Eigen/Geometry>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

/// White paper whose rim carries ArUco markers, so that a picture tells where the paper lies, and
/// whose inside is blank, so that it tells where the light comes from. Its frame: millimetres,
/// origin at the centre of the paper, x right and y up as printed, z out of the paper.
///
/// Markers stand 5 mm from the paper's edges, which printers leave white, at least 0.4 of a marker
/// apart, with ids 0, 1, ... clockwise from the top left corner.
struct SheetBorder {
  Eigen::Vector2d size_mm = Eigen::Vector2d::Zero();  // size of the paper
  double marker_mm = 0.0;
  std::string dictionary = {};
  std::string paper = {};  // as it was named: "A4"; a size where it has no name

  // Returns the text as ParseSheetBorder() reads it.
  [[nodiscard]] std::string Text() const;
  // Centres of the markers in the order of their ids.
  [[nodiscard]] std::vector<Eigen::Vector3d> MarkerCenters() const;
  // Returns the inside, a sixth of a marker away from the markers.
  [[nodiscard]] Eigen::AlignedBox2d BlankMm() const;
};

/// "sheet:A4:12mm"                      paper, marker; A4 and its like lie on their long side
/// "sheet:200x150mm:10mm:DICT_5X5_250"  and, optional, dictionary
///
/// The dictionary is DICT_4X4_50, or the smallest of the same kind that has enough markers.
/// Errors   kInvalidArgument: another form; markers of less than 2 mm, or so large that no inside
///          of a third of the paper each way is left; fewer than three along a side; too small a
///          dictionary
[[nodiscard]] Result<SheetBorder> ParseSheetBorder(std::string_view text);

}  // namespace sateen
