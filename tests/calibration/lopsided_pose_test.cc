#include <gtest/gtest.h>

#include "calibration/print/pose_solve.h"
#include "tests/testing/lopsided_rig.h"

namespace sateen::lopsided_pose_test {
namespace {

// Points of the table at the pixels that a lopsided camera shows them at, by hand.
TEST(SolvePlanePose, FindsALopsidedCamera) {
  const Camera camera = testing::LopsidedCamera();
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<Eigen::Vector2d> corners_px;
  for (int v = 2; v < camera.size_px.height; v += 22) {
    for (int u = 3; u < camera.size_px.width; u += 22) {
      points_mm.push_back(testing::TablePointByHand(camera, u, v));
      corners_px.emplace_back(u, v);
    }
  }
  const Result<PlanePose> pose = SolvePlanePose(camera, points_mm, corners_px);
  ASSERT_TRUE(pose) << pose.error().message;
  const Eigen::Isometry3d expected = camera.table_from_camera.inverse();
  EXPECT_LT(pose->rms_px, 1e-6);
  EXPECT_LT((pose->camera_from_plane.linear() - expected.linear()).norm(), 1e-7);
  EXPECT_LT((pose->camera_from_plane.translation() - expected.translation()).norm(), 1e-4);
}

}  // namespace
}  // namespace sateen::lopsided_pose_test
