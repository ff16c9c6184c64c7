#include "scanner/sessions/sheet_blocks.h"

#include <gtest/gtest.h>

namespace sateen::sheet_blocks_test {
namespace {

// 90 x 60 px of 4 mm, straight above the table.
Camera CameraAbove() {
  Camera camera;
  camera.size_px = {90, 60};
  camera.fx = camera.fy = 150.0;
  camera.cx = 44.5;
  camera.cy = 29.5;
  camera.table_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.table_from_camera.translation() = Eigen::Vector3d(0, 0, 600);
  camera.has_pose = true;
  return camera;
}

BlockMeans Blocks() {
  BlockMeans means{.size_px = {90, 60}, .grid = {.columns = 9, .rows = 6}};
  means.blocks.resize(54);
  return means;
}

// Blocks of 40 mm under a sheet with a blank inside of 244 x 168 mm, moved by 16 mm to the right:
// from -106 to 138 and from -84 to 84 mm, whole blocks from -100 to 100 and from -80 to 80.
TEST(SheetBlocks, OnlyTheBlankInsideCounts) {
  const SheetBorder border = ParseSheetBorder("sheet:282x206mm:12mm").value();
  ASSERT_NEAR(border.BlankMm().sizes().x(), 244.0, 1e-9);
  const Eigen::Isometry3d moved(Eigen::Translation3d(16, 0, 0));
  const Places places = PlacesOf(Blocks(), CameraAbove(), moved, border);
  ASSERT_EQ(places.size(), 54U);
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 9; ++column) {
      const auto& place = places[static_cast<size_t>(9 * row + column)];
      EXPECT_EQ(place.has_value(), row >= 1 && row <= 4 && column >= 2 && column <= 6)
          << row << ' ' << column;
      if (place) {
        EXPECT_NEAR(place->x(), 40.0 * (column - 4), 1e-9);
        EXPECT_NEAR(place->y(), -40.0 * (row - 2.5), 1e-9);
      }
    }
  }
  const Places everywhere = PlacesOf(Blocks(), CameraAbove(), moved, std::nullopt);
  EXPECT_EQ(std::ranges::count_if(everywhere, [](const auto& p) { return p.has_value(); }), 54);
}

// A dark border around the sheet, larger than the sheet, makes no dark frame.
TEST(SheetBlocks, SharesAreOfTheBlocksThatCount) {
  std::vector<BlockSample> blocks(10);
  Places places(10);
  for (size_t i = 0; i < 4; ++i) {
    places[i] = Eigen::Vector3d::Zero();
    blocks[i].is_lit = i != 0;
    blocks[i].saturated = i == 3;
  }
  const Spoilt spoilt = SpoiltOf(blocks, places);
  EXPECT_EQ(spoilt.unlit, 0.25);
  EXPECT_EQ(spoilt.saturated, 0.25);
  EXPECT_EQ(spoilt.Fault(), FrameFault::kNone);
  EXPECT_EQ(SpoiltOf(blocks, Places(10, Eigen::Vector3d::Zero())).Fault(), FrameFault::kDark);
  EXPECT_EQ((Spoilt{.saturated = 0.6, .unlit = 0.6}).Fault(), FrameFault::kSaturated);
  EXPECT_EQ((Spoilt{.saturated = 0.5, .unlit = 0.5}).Fault(), FrameFault::kNone);
}

}  // namespace
}  // namespace sateen::sheet_blocks_test
