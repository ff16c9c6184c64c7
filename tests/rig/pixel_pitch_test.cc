#include "rig/pixel_pitch.h"

#include <gtest/gtest.h>

#include <cmath>

#include "rig/projection.h"

namespace sateen::pixel_pitch_test {
namespace {

// A camera straight above the table at 500 mm; all intrinsics differ, the principal point is far
// from the middle of the image.
Camera ObliqueFreeCamera() {
  Camera camera{.size_px = {641, 401}, .fx = 1000.0, .fy = 1600.0, .cx = 200.0, .cy = 300.0};
  camera.table_from_camera.linear() = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  camera.table_from_camera.translation() = Eigen::Vector3d(30.0, -20.0, 500.0);
  return camera;
}

TEST(PixelPitch, IsTheSideOfASquareOfThePixelsArea) {
  // A pixel is 500 / 1000 mm wide and 500 / 1600 mm high.
  EXPECT_NEAR(PixelPitchMm(ObliqueFreeCamera()).value(), 500.0 / std::sqrt(1000.0 * 1600.0), 1e-9);
}

TEST(PixelPitch, BelongsToTheMiddlePixel) {
  Camera camera = ObliqueFreeCamera();
  camera.table_from_camera.rotate(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()));
  camera.distortion = {0.08, -0.02, 0.003, -0.002, 0.0};

  // Pixel centres are at integers: the middle of 641 x 401 pixels is (320, 200).
  const Eigen::Vector3d middle = TablePointOfPixel(camera, 320.0, 200.0).value();
  const Eigen::Vector3d right = TablePointOfPixel(camera, 321.0, 200.0).value() - middle;
  const Eigen::Vector3d down = TablePointOfPixel(camera, 320.0, 201.0).value() - middle;

  const double area_mm2 = std::abs(right.x() * down.y() - right.y() * down.x());
  EXPECT_NEAR(PixelPitchMm(camera).value(), std::sqrt(area_mm2), 1e-9);
  // Half a pixel aside it is another: the tilt makes it grow by about 0.05 % per pixel.
  const Eigen::Vector3d aside = TablePointOfPixel(camera, 320.5, 200.5).value();
  const Eigen::Vector3d aside_right = TablePointOfPixel(camera, 321.5, 200.5).value() - aside;
  const Eigen::Vector3d aside_down = TablePointOfPixel(camera, 320.5, 201.5).value() - aside;
  EXPECT_GT(std::abs(aside_right.cross(aside_down).norm() - area_mm2), 1e-6);
}

TEST(PixelPitch, GrowsWithTheDistanceOfTheTable) {
  Camera near = ObliqueFreeCamera();
  Camera far = near;
  far.table_from_camera.translation().z() *= 3.0;
  EXPECT_NEAR(PixelPitchMm(far).value(), 3.0 * PixelPitchMm(near).value(), 1e-9);
}

TEST(PixelPitch, IsAbsentWhereTheCameraLooksAway) {
  Camera camera = ObliqueFreeCamera();
  camera.table_from_camera.linear() = Eigen::Matrix3d::Identity();
  EXPECT_FALSE(PixelPitchMm(camera).has_value());
}

}  // namespace
}  // namespace sateen::pixel_pitch_test
