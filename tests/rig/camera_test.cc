#include "rig/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <random>

#include "core/angle.h"
#include "rig/projection.h"
#include "rig/table_grid.h"

namespace sateen::camera_test {
namespace {

using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A strong wide-angle lens, 53 degrees across, tilted and turned over the table.
Camera TiltedCamera(ImageSize size_px) {
  Camera camera = OverheadCamera(size_px, /*distance_mm=*/500, /*width_mm=*/500);
  camera.distortion = {-0.3, 0.1, 1e-3, -5e-4, 0.0};
  const Eigen::AngleAxisd tilt(20 * kRadPerDeg, Eigen::Vector3d(0.8, 0.6, 0.0));
  camera.table_from_camera = tilt * camera.table_from_camera;
  return camera;
}

TEST(OverheadCamera, SeesItsWidthWithXRightAndYUp) {
  const Camera camera = OverheadCamera({400, 200}, /*distance_mm=*/500, /*width_mm=*/100);
  ASSERT_TRUE(camera.Validate("camera"));

  // 0.25 mm per pixel; the corner pixel's centre lies half a pixel inside the 100 x 50 mm seen.
  const Eigen::Vector3d top_left = TablePointOfPixel(camera, 0, 0).value();
  EXPECT_NEAR(top_left.x(), -49.875, 1e-12);  // rounding
  EXPECT_NEAR(top_left.y(), 24.875, 1e-12);
  EXPECT_EQ(top_left.z(), 0.0);
  const Eigen::Vector3d bottom_right = TablePointOfPixel(camera, 399, 199).value();
  EXPECT_NEAR(bottom_right.x(), 49.875, 1e-12);
  EXPECT_NEAR(bottom_right.y(), -24.875, 1e-12);
}

TEST(OverheadCamera, LooksStraightDownFromItsDistance) {
  const Camera camera = OverheadCamera({401, 201}, 500, 100);
  EXPECT_TRUE(camera.table_from_camera.translation().isApprox(Eigen::Vector3d(0, 0, 500)));
  EXPECT_TRUE(RayOfPixel(camera, 200, 100).value().isApprox(-Eigen::Vector3d::UnitZ()));
  EXPECT_NEAR(camera.table_from_camera.linear().determinant(), 1.0, 1e-15);
}

TEST(PixelOfTablePoint, FollowsThePinholeEquations) {
  Camera camera;
  camera.size_px = {640, 480};
  camera.fx = 1000;
  camera.fy = 1100;
  camera.cx = 320;
  camera.cy = 240;
  // At (10, 20, 300) mm, its axes those of the table but for y and z.
  camera.table_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.table_from_camera.translation() = Eigen::Vector3d(10, 20, 300);

  // The table point (40, 50, 0) is (30, -30, 300) in the camera: x = 0.1, y = -0.1.
  const Eigen::Vector2d pixel = PixelOfTablePoint(camera, {40, 50, 0});
  EXPECT_NEAR(pixel.x(), 1000 * 0.1 + 320, 1e-10);
  EXPECT_NEAR(pixel.y(), 1100 * -0.1 + 240, 1e-10);
}

TEST(PixelOfTablePoint, DistortsAsOpenCvDoes) {
  // By hand for x = 0.3, y = -0.2: r^2 = 0.13, r^4 = 0.0169, r^6 = 0.002197,
  //   radial = 1 - 0.3 * 0.13 + 0.1 * 0.0169 + 0.05 * 0.002197                    = 0.96279985
  //   x' = 0.3 radial  + 2 p1 (-0.06) + p2 (0.13 + 0.18), p1 = 0.01, p2 = -0.02   = 0.281439955
  //   y' = -0.2 radial + p1 (0.13 + 0.08) + 2 p2 (-0.06)                          = -0.18805997
  Camera camera = OverheadCamera({1000, 1000}, 1000, 1000);
  camera.distortion = {-0.3, 0.1, 0.01, -0.02, 0.05};
  const Eigen::Vector2d pixel = PixelOfTablePoint(camera, {300, 200, 0});
  EXPECT_NEAR(pixel.x(), 1000 * 0.281439955 + 499.5, 1e-9);
  EXPECT_NEAR(pixel.y(), 1000 * -0.18805997 + 499.5, 1e-9);
}

TEST(TablePointOfPixel, InvertsPixelOfTablePoint) {
  const Camera camera = TiltedCamera({1200, 800});
  for (double v = 0; v < 800; v += 47) {
    for (double u = 0; u < 1200; u += 53) {
      const std::optional<Eigen::Vector3d> point = TablePointOfPixel(camera, u, v, 3.5);
      ASSERT_TRUE(point) << u << ", " << v;
      EXPECT_EQ(point->z(), 3.5);
      EXPECT_LT((PixelOfTablePoint(camera, *point) - Eigen::Vector2d(u, v)).norm(), 1e-9);
    }
  }
}

TEST(RayOfPixel, PassesThroughTheTablePointAndTheCamera) {
  const Camera camera = TiltedCamera({1200, 800});
  const Eigen::Vector3d ray = RayOfPixel(camera, 900, 100).value();
  const Eigen::Vector3d to_table =
      TablePointOfPixel(camera, 900, 100).value() - camera.table_from_camera.translation();
  EXPECT_NEAR(ray.norm(), 1.0, 1e-15);
  EXPECT_NEAR(ray.dot(to_table.normalized()), 1.0, 1e-15);
}

TEST(RayOfPixel, NothingBeyondTheFoldOfTheLens) {
  // x' = x (1 - 0.3 x^2) is largest at x = sqrt(1 / 0.9), where it is 0.70273.
  Camera camera = OverheadCamera({2001, 2001}, 1000, 2001);  // f = 1000 px, centre at 1000
  camera.distortion = {-0.3, 0, 0, 0, 0};
  EXPECT_TRUE(RayOfPixel(camera, 1702.7, 1000));
  EXPECT_FALSE(RayOfPixel(camera, 1702.8, 1000));
  EXPECT_FALSE(RayOfPixel(camera, 2000, 2000));
}

TEST(RayOfPixel, NothingFromTheImageBehindAFold) {
  // x (1 - 0.5 x^2 + 0.1 x^4) falls from x = 1 to x = sqrt(2) and grows again; x' = 0.62 has a
  // ray beyond only, where the lens model means nothing.
  Camera camera = OverheadCamera({2001, 2001}, 1000, 2001);
  camera.distortion = {-0.5, 0.1, 0, 0, 0};
  EXPECT_TRUE(RayOfPixel(camera, 1599, 1000));
  EXPECT_FALSE(RayOfPixel(camera, 1620, 1000));
}

TEST(RayOfPixel, ReachesTheFoldOfTangentialDistortion) {
  // On the axes x' = x + 3 p2 x^2 and y' = y + 3 p1 y^2: with 0.5, least at -1/3, where it is -1/6.
  // So close to that, only a step by the right derivative arrives.
  Camera camera = OverheadCamera({2001, 2001}, 1000, 2001);
  camera.distortion = {0, 0, 0, 0.5, 0};
  EXPECT_TRUE(RayOfPixel(camera, 1000 - 166.66, 1000));
  EXPECT_FALSE(RayOfPixel(camera, 1000 - 166.67, 1000));
  camera.distortion = {0, 0, 0.5, 0, 0};
  EXPECT_TRUE(RayOfPixel(camera, 1000, 1000 - 166.66));
  EXPECT_FALSE(RayOfPixel(camera, 1000, 1000 - 166.67));
}

// Any lens, also such that a plain Newton iteration would leave its invertible part.
TEST(RayOfPixel, InvertsRandomLensesUpToTheirFold) {
  std::mt19937 random(/*seed=*/1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int tried = 0;
  for (int lens = 0; lens < 20'000; ++lens) {
    Camera camera = OverheadCamera({1000, 1000}, 1000, 1000);
    const double k1 = 0.6 * uniform(random);
    const double k2 = 0.4 * uniform(random);
    const double k3 = 0.2 * uniform(random);
    camera.distortion = {k1, k2, 3e-3 * uniform(random), 3e-3 * uniform(random), k3};
    const Eigen::Vector3d point(800 * uniform(random), 800 * uniform(random), 0.0);
    double least_growth = 1.0;  // growth of the distorted radius, on the way to the point
    for (double s = 0.0; s < 1.0; s += 0.01) {
      const double r2 = s * point.squaredNorm() * 1e-6;
      least_growth = std::min(least_growth, 1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3)));
    }
    if (least_growth < 0.1) {
      continue;
    }
    ++tried;
    const Eigen::Vector2d pixel = PixelOfTablePoint(camera, point);
    const std::optional<Eigen::Vector3d> found = TablePointOfPixel(camera, pixel.x(), pixel.y());
    ASSERT_TRUE(found) << "lens " << lens;
    EXPECT_LT((*found - point).norm(), 1e-9) << "lens " << lens;  // [mm] at 1 m: rounding
  }
  EXPECT_GT(tried, 10'000);
}

TEST(TablePointOfPixel, NothingWhereTheRayMissesTheTable) {
  Camera camera = OverheadCamera({101, 101}, 500, 1000);
  const Eigen::AngleAxisd to_horizon(80 * kRadPerDeg, Eigen::Vector3d::UnitX());
  camera.table_from_camera.linear() = to_horizon * camera.table_from_camera.linear();
  EXPECT_TRUE(TablePointOfPixel(camera, 50, 50));  // 10 degrees below the horizon
  EXPECT_FALSE(TablePointOfPixel(camera, 50, 0));  // 45 degrees further up
  EXPECT_FALSE(TablePointOfPixel(camera, 50, 50, /*height_mm=*/600));  // above the camera
}

TEST(Camera, ValidateNamesTheFieldOutOfRange) {
  const Camera good = TiltedCamera({64, 48});
  ASSERT_TRUE(good.Validate("camera"));
  const auto message = [&](auto change) {
    Camera camera = good;
    change(camera);
    const Status status = camera.Validate("rig.json: camera");
    EXPECT_TRUE(!status && status.error().code == ErrorCode::kBadData);
    return status ? "" : status.error().message;
  };
  EXPECT_THAT(message([](Camera& c) { c.size_px.width = 0; }),
              HasSubstr("rig.json: camera.size_px: 0 x 48; need 1 to 65536"));
  EXPECT_THAT(message([](Camera& c) { c.fy = 0; }), HasSubstr("fy = 0; need focal lengths > 0"));
  EXPECT_THAT(message([](Camera& c) { c.fx = kNaN; }), HasSubstr("camera.k: fx = nan"));
  EXPECT_THAT(message([](Camera& c) { c.cy = kNaN; }), HasSubstr("camera.k: cx"));
  EXPECT_THAT(message([](Camera& c) { c.distortion[4] = kNaN; }), HasSubstr("camera.distortion"));
  EXPECT_THAT(message([](Camera& c) { c.table_from_camera.matrix()(0, 0) += 1e-3; }),
              HasSubstr("camera.table_from_camera: the rotation is off by"));
  EXPECT_THAT(message([](Camera& c) { c.table_from_camera.linear().col(0) *= -1.0; }),
              HasSubstr("determinant -1"));
  EXPECT_THAT(message([](Camera& c) { c.table_from_camera.matrix()(3, 0) = 1; }),
              HasSubstr("last row is [1, 0, 0, 1]; need [0, 0, 0, 1]"));
  EXPECT_THAT(message([](Camera& c) { c.table_from_camera.translation().z() = -1; }),
              HasSubstr("at z = -1 mm; need z > 0"));
}

// The largest distance, in pixels, between where a pixel is and where the grid's position of it
// appears.
double WorstErrorPx(const Camera& camera) {
  const TableGrid grid = TableGrid::Make(camera).value();
  EXPECT_EQ(grid.Size(), camera.size_px);
  std::vector<float> x_mm(static_cast<size_t>(camera.size_px.width));
  std::vector<float> y_mm(x_mm.size());
  double worst_px = 0.0;
  for (int v = 0; v < camera.size_px.height; ++v) {
    grid.Row(v, x_mm, y_mm);
    for (size_t u = 0; u < x_mm.size(); ++u) {
      const Eigen::Vector3d point(static_cast<double>(x_mm[u]), static_cast<double>(y_mm[u]), 0);
      const Eigen::Vector2d error =
          PixelOfTablePoint(camera, point) - Eigen::Vector2d(static_cast<double>(u), v);
      worst_px = std::max(worst_px, error.norm());
    }
  }
  return worst_px;
}

TEST(TableGrid, EveryPixelIsWithinItsBound) {
  for (const ImageSize size_px :
       {ImageSize{1200, 800}, ImageSize{640, 480}, ImageSize{320, 240}, ImageSize{128, 96},
        ImageSize{17, 40}, ImageSize{5, 3}, ImageSize{2, 1}, ImageSize{1, 2}, ImageSize{1, 1}}) {
    EXPECT_LT(WorstErrorPx(TiltedCamera(size_px)), 1e-3)
        << size_px.width << " x " << size_px.height;
  }
}

TEST(TableGrid, AffineViewsAreExactButForRounding) {
  // Positions reach 50 mm: rounding to float is at most 2e-6 mm, 1e-5 px of 0.25 mm.
  EXPECT_LT(WorstErrorPx(OverheadCamera({403, 201}, 500, 100)), 2e-5);
}

TEST(TableGrid, CameraThatSeesPastTheTableIsRefused) {
  Camera camera = OverheadCamera({101, 101}, 500, 1000);
  const Eigen::AngleAxisd to_horizon(80 * kRadPerDeg, Eigen::Vector3d::UnitX());
  camera.table_from_camera.linear() = to_horizon * camera.table_from_camera.linear();
  const Result<TableGrid> grid = TableGrid::Make(camera);
  ASSERT_FALSE(grid);
  EXPECT_EQ(grid.error().code, ErrorCode::kBadData);
  EXPECT_THAT(grid.error().message, HasSubstr("pixel (0, 0) does not see the table"));
}

TEST(TableGrid, LensThatNoGridFollowsIsRefused) {
  // The corners lie just before the fold, where the inverse has an infinite slope.
  Camera camera = OverheadCamera({2001, 3}, 1000, 2001);
  camera.distortion = {-4.0 / 27.0 + 1e-9, 0, 0, 0, 0};
  const Result<TableGrid> grid = TableGrid::Make(camera);
  ASSERT_FALSE(grid);
  EXPECT_THAT(grid.error().message, HasSubstr("calibrate the camera again"));
}

}  // namespace
}  // namespace sateen::camera_test
