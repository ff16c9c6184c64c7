#include "scanner/sessions/files/patch_places.h"

#include <gtest/gtest.h>

#include "core/angle.h"
#include "rig/projection.h"

namespace sateen::patch_places_test {
namespace {

// Two pixels a millimetre; the table's origin lies at pixel (199.5, 149.5), y up.
Camera TwoPixelsAMm() { return OverheadCamera({400, 300}, 500.0, 200.0); }

RawMosaic Mosaic() {
  RawMosaic mosaic;
  mosaic.samples = Image<float>(400, 300);
  mosaic.cfa = {0, 1, 1, 2};
  return mosaic;
}

TEST(PlacesOf, TheMiddleOfAPatch) {
  const ChartPatch patch = {.name = "white", .center_mm = {20.1, 10.1}};
  const PatchPlaces places =
      PlacesOf(patch, 50.0, TwoPixelsAMm(), Eigen::Isometry2d::Identity(), Mosaic());

  ASSERT_EQ(places.index.size(), 60U * 60U);  // 60 % of 50 mm
  std::array<size_t, 3> of_colour = {};
  for (size_t i = 0; i < places.index.size(); ++i) {
    const auto x = static_cast<int>(places.index[i] % 400);
    const auto y = static_cast<int>(places.index[i] / 400);
    ASSERT_TRUE(x >= 210 && x < 270 && y >= 100 && y < 160) << x << ' ' << y;
    ASSERT_EQ(places.sites.colour[i], Mosaic().cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
    // Parts in rows from the chart's lower edge.
    const auto column = static_cast<int>((x - 209.7) / 7.5);
    const auto row = static_cast<int>((159.3 - y) / 7.5);
    ASSERT_EQ(places.sites.block[i], row * 8 + column) << x << ' ' << y;
    ++of_colour[places.sites.colour[i]];
  }
  EXPECT_EQ(of_colour, (std::array<size_t, 3>{900, 1800, 900}));
  EXPECT_LT((places.corners_px[0] - Eigen::Vector2d(209.7, 159.3)).norm(), 1e-9);
  EXPECT_LT((places.corners_px[2] - Eigen::Vector2d(269.7, 99.3)).norm(), 1e-9);
}

TEST(PlacesOf, AChartThatIsTurnedAndShifted) {
  Eigen::Isometry2d table_from_chart(Eigen::Translation2d(5.0, -3.0));
  table_from_chart.rotate(Eigen::Rotation2Dd(90.0 * kRadPerDeg));  // its x is the table's y
  const ChartPatch patch = {.name = "white", .center_mm = {20.0, 10.0}};
  const PatchPlaces places = PlacesOf(patch, 50.0, TwoPixelsAMm(), table_from_chart, Mosaic());
  // Middle at (5 - 10, -3 + 20) mm.
  EXPECT_EQ(places.index.size(), 60U * 60U);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : places.corners_px) {
    middle += 0.25 * corner;
  }
  EXPECT_LT((middle - Eigen::Vector2d(199.5 - 10.0, 149.5 - 34.0)).norm(), 1e-9);
}

TEST(PlacesOf, APatchCutByTheEdgeOrOutside) {
  ChartPatch patch = {.name = "white", .center_mm = {100.0, 0.0}};
  const auto count = [&] {
    return PlacesOf(patch, 50.0, TwoPixelsAMm(), Eigen::Isometry2d::Identity(), Mosaic())
        .index.size();
  };
  EXPECT_EQ(count(), 30U * 60U);
  patch.center_mm = {0.0, -400.0};
  EXPECT_EQ(count(), 0U);
}

}  // namespace
}  // namespace sateen::patch_places_test
