#include "calibration/lens/pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calibration/synthetic_boards.h"

namespace sateen::pose_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;

const BoardSpec& Board() {
  static const BoardSpec spec = ParseBoardSpec("charuco:10x7:20mm:15mm").value();
  return spec;
}

double AngleDeg(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear() * b.linear().transpose()).angle() * kDegPerRad;
}

TEST(FitPose, AnOverheadCameraComesBackHoweverTheBoardLies) {
  const Camera truth = LensOf3000Px();
  for (const double turn_deg : {0.0, 37.0, 90.0, 180.0, 251.0}) {
    const BoardView view =
        SeenBoard(truth, Board(), CameraFromBoard(turn_deg, 0, 0, {0, 0, 600}), 0.0, 1);
    const PoseFit fit = FitPose(truth, view).value();
    EXPECT_LT(AngleDeg(fit.table_from_camera, truth.table_from_camera), 1e-6) << turn_deg;
    EXPECT_LT((fit.table_from_camera.translation() - Eigen::Vector3d(0, 0, 600)).norm(), 1e-5);
    const Eigen::AngleAxisd turn(turn_deg * kRadPerDeg, Eigen::Vector3d::UnitZ());
    EXPECT_LT((fit.table_from_board.linear() - turn.toRotationMatrix()).norm(), 1e-7);
    EXPECT_LT(fit.table_from_board.translation().norm(), 1e-9);
  }
}

TEST(FitPose, NoisyBoardsUnderTiltedCamerasGiveThePoseAndItsErrors) {
  const Camera lens = LensOf3000Px();
  constexpr int kRuns = 60;
  double worst_deg = 0.0;
  double worst_mm = 0.0;
  double off2 = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const Eigen::Isometry3d camera_from_board =
        CameraFromBoard(17.0 * run, 15.0 + 0.5 * run, 40.0 * run, {20, -10, 600});
    const auto truth = FitPose(lens, SeenBoard(lens, Board(), camera_from_board, 0.0, 1)).value();
    // The truth of the frame itself: z is the board's normal, x has no part along the camera's y.
    const Eigen::Vector3d z = camera_from_board.linear().col(2);
    EXPECT_LT((truth.table_from_camera.linear() * z - Eigen::Vector3d::UnitZ()).norm(), 1e-7);
    EXPECT_GT(truth.table_from_camera.linear()(0, 0), 0.0);
    EXPECT_NEAR(truth.table_from_camera.linear()(1, 0), 0.0, 1e-9);
    EXPECT_LT((truth.table_from_camera * camera_from_board.translation()).norm(), 1e-4);

    const PoseFit fit = FitPose(lens, SeenBoard(lens, Board(), camera_from_board, 0.1,
                                                static_cast<uint64_t>(100 + run)))
                            .value();
    const Eigen::Vector3d off_mm =
        fit.table_from_camera.translation() - truth.table_from_camera.translation();
    const Eigen::AngleAxisd turn(fit.table_from_camera.linear() *
                                 truth.table_from_camera.linear().transpose());
    Eigen::Matrix<double, 6, 1> off;
    off << turn.angle() * turn.axis(), off_mm;
    worst_deg = std::max(worst_deg, turn.angle() * kDegPerRad);
    worst_mm = std::max(worst_mm, off_mm.norm());
    Eigen::Matrix<double, 6, 1> sd;
    sd << fit.rotation_sd_rad, fit.position_sd_mm;
    off2 += off.cwiseQuotient(sd).squaredNorm() / (6.0 * kRuns);
  }
  RecordProperty("worst", fmt::format("{:.4f} deg {:.3f} mm", worst_deg, worst_mm));
  EXPECT_LT(worst_deg, 0.05);
  EXPECT_LT(worst_mm, 0.5);
  EXPECT_NEAR(std::sqrt(off2), 1.0, 0.25);  // the standard deviations are those of the errors
}

// The bar: corners as FindBoard() sees them (0.045 px, board_find_test), of a board that fills the
// picture, from straight above to a camera that leans by 25 degrees.
TEST(FitPose, WithinTheBarFromCornersAsTheyAreFound) {
  const Camera lens = LensOf3000Px();
  const BoardSpec board = ParseBoardSpec("charuco:14x10:20mm:15mm").value();
  double worst_deg = 0.0;
  double worst_mm = 0.0;
  for (int run = 0; run < 60; ++run) {
    const auto pose = CameraFromBoard(17.0 * run, 0.42 * run, 40.0 * run, {10, -10, 600});
    const PoseFit truth = FitPose(lens, SeenBoard(lens, board, pose, 0.0, 1)).value();
    const PoseFit fit = FitPose(lens, SeenBoard(lens, board, pose, 0.045 / std::sqrt(2.0),
                                                static_cast<uint64_t>(100 + run)))
                            .value();
    worst_deg = std::max(worst_deg, AngleDeg(fit.table_from_camera, truth.table_from_camera));
    worst_mm = std::max(
        worst_mm,
        (fit.table_from_camera.translation() - truth.table_from_camera.translation()).norm());
  }
  fmt::print("worst of 60 poses: {:.4f} degrees, {:.4f} mm\n", worst_deg, worst_mm);
  EXPECT_LT(worst_deg, 0.05);
  EXPECT_LT(worst_mm, 0.1);
}

TEST(MeanView, AveragesPicturesOfOneBoardAndNotOfTwo) {
  const Camera lens = LensOf3000Px();
  const auto pose = CameraFromBoard(10, 3, 0, {0, 0, 600});
  const BoardView exact = SeenBoard(lens, Board(), pose, 0.0, 1);
  BoardView first = SeenBoard(lens, Board(), pose, 0.2, 1);
  BoardView second = SeenBoard(lens, Board(), pose, 0.2, 2);
  first.ids.erase(first.ids.begin());  // found in the second picture only
  first.corners_px.erase(first.corners_px.begin());
  first.points_mm.erase(first.points_mm.begin());
  const BoardView mean = MeanView({first, second}).value();
  EXPECT_EQ(mean.ids, exact.ids);
  EXPECT_EQ(mean.points_mm, exact.points_mm);
  EXPECT_EQ(mean.corners_px[0], second.corners_px[0]);
  EXPECT_LT((mean.corners_px[7] - 0.5 * (first.corners_px[6] + second.corners_px[7])).norm(), 1e-9);
  for (Eigen::Vector2d& corner : second.corners_px) {
    corner.x() += 2.0;
  }
  second.name = "moved.jpg";
  EXPECT_THAT(MeanView({first, second}).error().message,
              HasSubstr("moved.jpg: its corners are 2."));
}

TEST(FitPose, ErrorsSayWhatToDo) {
  const Camera lens = LensOf3000Px();
  BoardView view = SeenBoard(lens, Board(), CameraFromBoard(0, 0, 0, {0, 0, 600}), 0.1, 1);
  BoardView other = view;
  other.size_px = {640, 480};
  EXPECT_THAT(FitPose(lens, other).error().message, HasSubstr("use pictures of one size"));
  BoardView row = view;
  row.ids.resize(9);
  row.corners_px.resize(9);
  row.points_mm.resize(9);
  EXPECT_THAT(FitPose(lens, row).error().message, HasSubstr("do not lie in one line"));
  const BoardSpec tiny = ParseBoardSpec("chessboard:3x3:2mm").value();
  const BoardView far = SeenBoard(lens, tiny, CameraFromBoard(0, 20.0, 0, {0, 0, 900}), 0.5, 3);
  EXPECT_THAT(FitPose(lens, far).error().message, HasSubstr("equally well"));
}

}  // namespace
}  // namespace sateen::pose_test
