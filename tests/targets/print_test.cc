#include "targets/print.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "targets/marker_dictionary.h"

namespace sateen::print_test {
namespace {

using ::testing::HasSubstr;

BoardSpec Board(const char* text) { return ParseBoardSpec(text).value(); }

// Tells black from white by the board's own description, square by square and cell by cell.
bool IsBlackBySpec(const BoardSpec& spec, double x, double y) {
  const int column = static_cast<int>(std::floor(x / spec.square_mm + 0.5 * spec.columns));
  const int row = static_cast<int>(std::floor(0.5 * spec.rows - y / spec.square_mm));
  if (column < 0 || row < 0 || column >= spec.columns || row >= spec.rows) {
    return false;
  }
  if (spec.IsBlack(column, row) || spec.pattern == BoardPattern::kChessboard) {
    return spec.IsBlack(column, row);
  }
  const std::vector<Eigen::Vector3d> centers = spec.MarkerCenters();
  for (size_t id = 0; id < centers.size(); ++id) {
    const double u = (x - centers[id].x()) / spec.marker_mm + 0.5;
    const double v = 0.5 - (y - centers[id].y()) / spec.marker_mm;
    if (std::min(u, v) >= 0.0 && std::max(u, v) < 1.0) {
      const Image<uint8_t> cells = MarkerCells(spec.dictionary, static_cast<int>(id));
      return cells.At(static_cast<int>(u * cells.width), static_cast<int>(v * cells.height)) == 0;
    }
  }
  return false;
}

TEST(Print, BoardsAreBlackWhereTheirSquaresAndCellsAre) {
  for (const char* text : {"chessboard:5x4:10mm", "charuco:5x4:20mm:15mm",
                           "charuco:4x4:20mm:14mm:DICT_5X5_50:legacy"}) {
    const BoardSpec spec = Board(text);
    const Print print = PrintOf(spec);
    EXPECT_EQ(print.SizeMm(), spec.square_mm * Eigen::Vector2d(spec.columns, spec.rows));
    int black = 0;
    for (double x = -61.17; x < 61.0; x += 0.73) {
      for (double y = -53.31; y < 53.0; y += 0.73) {
        ASSERT_EQ(print.IsBlackAt({x, y}), IsBlackBySpec(spec, x, y))
            << text << " at " << x << ", " << y;
        black += print.IsBlackAt({x, y}) ? 1 : 0;
      }
    }
    EXPECT_GT(black, 1000) << text;
  }
}

// Overlaps would be counted twice, gaps would be lines in what is printed.
TEST(Print, BoxesCoverEachPlaceOnce) {
  for (const char* text : {"charuco:10x7:25mm:18mm", "sheet:200x150mm:10mm"}) {
    const Print print = PrintNamed(text).value();
    const std::vector<Eigen::AlignedBox2d>& boxes = print.BlackMm();
    for (size_t i = 0; i < boxes.size(); ++i) {
      for (size_t k = i + 1; k < boxes.size(); ++k) {
        const Eigen::AlignedBox2d both = boxes[i].intersection(boxes[k]);
        ASSERT_LT(both.isEmpty() ? 0.0 : both.volume(), 1e-9) << text << ' ' << i << ' ' << k;
      }
      const Eigen::Vector2d last = boxes[i].max() - Eigen::Vector2d::Constant(1e-6);
      ASSERT_TRUE(print.IsBlackAt(boxes[i].min()) && print.IsBlackAt(last)) << text << ' ' << i;
    }
  }
}

TEST(Print, NamesBothKindsOfTargets) {
  EXPECT_EQ(PrintNamed("sheet:A4:12mm").value().SizeMm(), Eigen::Vector2d(297, 210));
  EXPECT_EQ(PrintNamed("chessboard:9x6:20mm").value().SizeMm(), Eigen::Vector2d(200, 140));
  EXPECT_THAT(PrintNamed("sheet:A4").error().message, HasSubstr("need \"sheet:A4:12mm\""));
  EXPECT_THAT(PrintNamed("circles").error().message, HasSubstr("need \"chessboard:9x6:24mm\""));
}

}  // namespace
}  // namespace sateen::print_test
