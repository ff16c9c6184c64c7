#include "rig/projection.h"

#include <gtest/gtest.h>

#include "tests/testing/lopsided_rig.h"

namespace sateen::projection_test {
namespace {

using testing::LopsidedCamera;
using testing::LopsidedRig;
using testing::TablePointByHand;

TEST(Projection, OfALopsidedCameraIsTheOneByHand) {
  const Camera camera = LopsidedCamera();
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(0, 0), Eigen::Vector2d(95, 0),
                                    Eigen::Vector2d(0, 69), Eigen::Vector2d(61.5, 12.25)}) {
    const Eigen::Vector3d expected = TablePointByHand(camera, px.x(), px.y());
    const auto point = TablePointOfPixel(camera, px.x(), px.y());
    ASSERT_TRUE(point);
    EXPECT_LT((*point - expected).norm(), 1e-9);
    EXPECT_LT((PixelOfTablePoint(camera, expected) - px).norm(), 1e-9);
    const auto pinhole = PixelOfPinholePixel(camera, px.x(), px.y());
    ASSERT_TRUE(pinhole);
    EXPECT_LT((*pinhole - px).norm(), 1e-9);
  }
}

TEST(RigToJson, KeepsEachFigureOfALopsidedRigInItsPlace) {
  const std::string text = RigToJson(LopsidedRig());
  EXPECT_NE(text.find(R"("size_px":[96,70])"), std::string::npos) << text;
  EXPECT_NE(text.find(R"("k":[301.0,347.0,43.25,38.5])"), std::string::npos) << text;
}

}  // namespace
}  // namespace sateen::projection_test
