#include "calibration/response/chart_find.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/angle.h"
#include "rig/projection.h"

namespace sateen::chart_find_test {
namespace {

using ::testing::HasSubstr;

Chart TwoRows() {
  Chart chart{.patch_mm = 20.0};
  const std::array<double, 6> values = {0.9, 0.36, 0.09, 0.2, 0.59, 0.04};
  for (size_t i = 0; i < values.size(); ++i) {
    chart.patches.push_back(
        {.name = fmt::format("p{}", i),
         .reflectance_rgb = Eigen::Vector3d::Constant(values[i]),
         .center_mm = {22.0 * (static_cast<double>(i % 3) - 1.0), i < 3 ? 11.0 : -11.0}});
  }
  return chart;
}

Light SideLight() {
  return {.name = "led", .model = LightModel::kNear, .position_mm = {400.0, 100.0, 420.0}};
}

Camera Overhead() {
  Camera camera = OverheadCamera({640, 480}, 600.0, 200.0);
  camera.distortion = {-0.2, 0.05, 0.0, 0.0, 0.0};
  return camera;
}

// Chart on grey as the camera sees it, 2 x 2 sites per cell.
Image<float> CellsOf(const Chart& chart, const Eigen::Isometry2d& table_from_chart) {
  const Camera camera = Overhead();
  Image<float> cells(320, 240);
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const auto point = TablePointOfPixel(camera, 2 * x + 0.5, 2 * y + 0.5);
      const Eigen::Vector2d at = table_from_chart.inverse() * Eigen::Vector2d(point->head<2>());
      double rho = 0.18;
      for (const ChartPatch& patch : chart.patches) {
        if ((at - patch.center_mm).cwiseAbs().maxCoeff() < 0.5 * chart.patch_mm) {
          rho = patch.reflectance_rgb[1];
        }
      }
      const Incident in = IncidentAt(SideLight(), *point);
      cells.At(x, y) = static_cast<float>(rho * in.e_rgb[1] * in.l.z());
    }
  }
  return cells;
}

Eigen::Isometry2d Pose(double x_mm, double y_mm, double turn_deg) {
  Eigen::Isometry2d pose = Eigen::Isometry2d::Identity();
  pose.translate(Eigen::Vector2d(x_mm, y_mm));
  pose.rotate(turn_deg * kRadPerDeg);
  return pose;
}

TEST(FindChart, GivesPlaceAndTurnAnyWayRound) {
  const Chart chart = TwoRows();
  for (const auto& [x, y, turn] : {std::tuple{0.0, 0.0, 0.0},
                                   {7.3, -4.1, 2.5},
                                   {-10.0, 9.0, 178.0},
                                   {3.0, 3.0, 91.0},
                                   {-2.0, 5.0, -93.0}}) {
    const auto found = FindChart(CellsOf(chart, Pose(x, y, turn)), Overhead(), SideLight(), chart);
    ASSERT_TRUE(found) << found.error().message;
    // A cell is 0.6 mm; the middle 96 % of a patch leave 0.4 mm to each side.
    EXPECT_LT((found->table_from_chart.translation() - Eigen::Vector2d(x, y)).norm(), 1.0) << turn;
    const Eigen::Rotation2Dd off(
        Eigen::Matrix2d(Pose(x, y, turn).linear().transpose() * found->table_from_chart.linear()));
    // The same over the 32 mm from the chart's middle to its end.
    EXPECT_LT(std::abs(off.smallestAngle()), 1.5 * kRadPerDeg) << turn;
    EXPECT_LT(found->misfit, 0.02);
  }
}

TEST(FindChart, SaysThatItIsNotThere) {
  const Chart chart = TwoRows();
  const auto message = [&](const Image<float>& cells, const FindChartOptions& options) {
    const auto found = FindChart(cells, Overhead(), SideLight(), chart, options);
    return found ? std::string("found") : found.error().message;
  };
  EXPECT_THAT(message(CellsOf({.patch_mm = 20.0}, Pose(0, 0, 0)), {}),
              HasSubstr("the chart was not found"));
  EXPECT_THAT(message(CellsOf(chart, Pose(45, 0, 0)), {}), HasSubstr("the chart was not found"));
  EXPECT_EQ(message(CellsOf(chart, Pose(30, 0, 0)), {.max_shift_mm = 33.0}), "found");
  EXPECT_THAT(message(Image<float>(320, 240), {}), HasSubstr("the chart was not found"));
  EXPECT_THAT(message(CellsOf(chart, Pose(0, 0, 0)), {.max_shift_mm = 0.0}),
              HasSubstr("max_shift_mm = 0"));
  EXPECT_THAT(message(CellsOf(chart, Pose(0, 0, 0)), {.max_turn_rad = 1.0}),
              HasSubstr("max_turn_rad = 1"));
}

TEST(Chart, NamesWhatIsOutOfRange) {
  const auto message = [](const auto& change) {
    Chart chart = TwoRows();
    change(chart);
    const Status status = chart.Validate("c.json");
    return status ? std::string("valid") : status.error().message;
  };
  EXPECT_EQ(message([](Chart&) {}), "valid");
  EXPECT_THAT(message([](Chart& chart) { chart.patch_mm = 0.0; }), HasSubstr("patch_mm is 0"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches.resize(2); }), HasSubstr("patches has 2"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches[3].reflectance_rgb[2] = 1.2; }),
              HasSubstr("patches[3]: reflectance of 'p3' is 0.2 to 1.2"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches[1].name = "p0"; }),
              HasSubstr("'p0' and 'p0' have one name"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches[1].center_mm.x() = -10.0; }),
              HasSubstr("'p0' and 'p1' overlap"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches[1].center_mm.y() = 1e30; }),
              HasSubstr("patches[1]: center_mm is"));
  EXPECT_THAT(message([](Chart& chart) { chart.patches.resize(2001); }),
              HasSubstr("patches has 2001; need at most 2000"));
}

}  // namespace
}  // namespace sateen::chart_find_test
