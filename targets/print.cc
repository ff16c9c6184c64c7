#include "targets/print.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "targets/marker_dictionary.h"

namespace sateen {
namespace {

constexpr double kMostBins = 1024.0;  // along a side

Eigen::AlignedBox2d BoxOf(double left, double top, double width, double height) {
  return {Eigen::Vector2d(left, top - height), Eigen::Vector2d(left + width, top)};
}

// Adds the runs of black cells of the marker's rows.
void AddMarker(const std::string& dictionary, int id, const Eigen::Vector3d& center_mm,
               double side_mm, std::vector<Eigen::AlignedBox2d>& black_mm) {
  const Image<uint8_t> cells = MarkerCells(dictionary, id);
  const double cell_mm = side_mm / cells.width;
  const double left = center_mm.x() - 0.5 * side_mm;
  const double top = center_mm.y() + 0.5 * side_mm;
  for (int row = 0; row < cells.height; ++row) {
    for (int begin = 0; begin < cells.width;) {
      int end = begin;
      while (end < cells.width && cells.At(end, row) == 0) {
        ++end;
      }
      if (end > begin) {
        black_mm.push_back(
            BoxOf(left + begin * cell_mm, top - row * cell_mm, (end - begin) * cell_mm, cell_mm));
      }
      begin = end + 1;
    }
  }
}

}  // namespace

Print::Print(const Eigen::Vector2d& size_mm, std::vector<Eigen::AlignedBox2d> black_mm)
    : size_mm_(size_mm), black_mm_(std::move(black_mm)) {
  // About as many bins as boxes, about square.
  const double side_mm = std::sqrt(size_mm_.prod() / static_cast<double>(black_mm_.size() + 1));
  bins_ = (size_mm_ / side_mm).array().ceil().min(kMostBins).cast<int>();
  boxes_of_bin_.resize(static_cast<size_t>(bins_.prod()));
  for (size_t i = 0; i < black_mm_.size(); ++i) {
    const Eigen::Vector2i first = BinOf(black_mm_[i].min());
    const Eigen::Vector2i last = BinOf(black_mm_[i].max());
    for (int row = first.y(); row <= last.y(); ++row) {
      for (int column = first.x(); column <= last.x(); ++column) {
        boxes_of_bin_[static_cast<size_t>(row) * static_cast<size_t>(bins_.x()) +
                      static_cast<size_t>(column)]
            .push_back(static_cast<uint32_t>(i));
      }
    }
  }
}

Eigen::Vector2i Print::BinOf(const Eigen::Vector2d& at_mm) const {
  const Eigen::Array2d share =
      (at_mm.array() / size_mm_.array() + 0.5) * bins_.cast<double>().array();
  return share.floor().max(0.0).cast<int>().min(bins_.array() - 1);
}

bool Print::IsBlackAt(const Eigen::Vector2d& at_mm) const {
  if (!Covers(at_mm)) {
    return false;
  }
  const Eigen::Vector2i bin = BinOf(at_mm);
  const auto& boxes = boxes_of_bin_[static_cast<size_t>(bin.y()) * static_cast<size_t>(bins_.x()) +
                                    static_cast<size_t>(bin.x())];
  return std::any_of(boxes.begin(), boxes.end(), [&](uint32_t i) {
    return (at_mm.array() >= black_mm_[i].min().array()).all() &&
           (at_mm.array() < black_mm_[i].max().array()).all();
  });
}

Print PrintOf(const BoardSpec& spec) {
  const Eigen::Vector2d size_mm = spec.square_mm * Eigen::Vector2d(spec.columns, spec.rows);
  std::vector<Eigen::AlignedBox2d> black_mm;
  for (int row = 0; row < spec.rows; ++row) {
    for (int column = 0; column < spec.columns; ++column) {
      if (spec.IsBlack(column, row)) {
        black_mm.push_back(BoxOf(-0.5 * size_mm.x() + column * spec.square_mm,
                                 0.5 * size_mm.y() - row * spec.square_mm, spec.square_mm,
                                 spec.square_mm));
      }
    }
  }
  if (spec.pattern == BoardPattern::kCharuco) {
    int id = 0;
    for (const Eigen::Vector3d& center : spec.MarkerCenters()) {
      AddMarker(spec.dictionary, id++, center, spec.marker_mm, black_mm);
    }
  }
  return {size_mm, std::move(black_mm)};
}

Print PrintOf(const SheetBorder& border) {
  std::vector<Eigen::AlignedBox2d> black_mm;
  int id = 0;
  for (const Eigen::Vector3d& center : border.MarkerCenters()) {
    AddMarker(border.dictionary, id++, center, border.marker_mm, black_mm);
  }
  return {border.size_mm, std::move(black_mm)};
}

Result<Print> PrintNamed(std::string_view spec) {
  if (spec.starts_with("sheet")) {
    return ParseSheetBorder(spec).map([](const SheetBorder& border) { return PrintOf(border); });
  }
  return ParseBoardSpec(spec).map([](const BoardSpec& board) { return PrintOf(board); });
}

}  // namespace sateen
