#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "targets/board.h"
#include "targets/sheet_border.h"

namespace sateen {

/// A board or a sheet as a printer prints it: black boxes on white paper. Its frame is the
/// target's: millimetres, origin at the centre, x right, y up.
class Print {
 public:
  // size_mm   of a board its squares, of a sheet the paper; centred on the origin
  // black_mm  boxes that do not overlap; each holds its low edges and not its high ones
  Print(const Eigen::Vector2d& size_mm, std::vector<Eigen::AlignedBox2d> black_mm);

  [[nodiscard]] const Eigen::Vector2d& SizeMm() const { return size_mm_; }
  [[nodiscard]] const std::vector<Eigen::AlignedBox2d>& BlackMm() const { return black_mm_; }
  // Returns true within the size: on the paper of a sheet, not on the white rim of a board.
  [[nodiscard]] bool Covers(const Eigen::Vector2d& at_mm) const {
    return (at_mm.array().abs() <= 0.5 * size_mm_.array()).all();
  }
  // O(1).
  [[nodiscard]] bool IsBlackAt(const Eigen::Vector2d& at_mm) const;

 private:
  [[nodiscard]] Eigen::Vector2i BinOf(const Eigen::Vector2d& at_mm) const;

  Eigen::Vector2d size_mm_;
  std::vector<Eigen::AlignedBox2d> black_mm_;
  Eigen::Vector2i bins_ = Eigen::Vector2i::Ones();
  std::vector<std::vector<uint32_t>> boxes_of_bin_;  // row by row
};

[[nodiscard]] Print PrintOf(const BoardSpec& spec);
[[nodiscard]] Print PrintOf(const SheetBorder& border);

// Returns the print of the target that `spec` names: "sheet:..." as ParseSheetBorder() reads it, or
// a board as ParseBoardSpec() does. Fails as they do.
[[nodiscard]] Result<Print> PrintNamed(std::string_view spec);

}  // namespace sateen
