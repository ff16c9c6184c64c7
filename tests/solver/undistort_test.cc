#include "solver/undistort.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "rig/projection.h"

namespace sateen::undistort_test {
namespace {

using ::testing::HasSubstr;

Camera BentCamera() {
  Camera camera = OverheadCamera({160, 120}, 500.0, 320.0);
  camera.cx += 3.0;
  camera.cy -= 2.0;
  camera.distortion = {-0.6, 0.2, 0.004, -0.003, 0.0};
  return camera;
}

// A field that is a smooth function of the place on the table, 40 mm a wave.
NormalField FieldOf(const Camera& camera) {
  NormalField field;
  field.Resize(camera.size_px);
  for (int v = 0; v < camera.size_px.height; ++v) {
    for (int u = 0; u < camera.size_px.width; ++u) {
      const Eigen::Vector3d x = TablePointOfPixel(camera, u, v).value();
      const Eigen::Vector3d n =
          Eigen::Vector3d(0.4 * std::sin(x.x() / 6.4), 0.3 * std::cos(x.y() / 6.4), 1.0)
              .normalized();
      for (size_t c = 0; c < 3; ++c) {
        field.normal[c].At(u, v) = static_cast<float>(n[static_cast<Eigen::Index>(c)]);
        field.albedo[c].At(u, v) =
            static_cast<float>(0.5 + 0.1 * static_cast<double>(c) * std::sin(x.y() / 8.0));
      }
      field.residual.At(u, v) = static_cast<float>(0.01 + 1e-4 * x.x());
      field.samples.At(u, v) = 10;
      field.reason.At(u, v) = static_cast<uint8_t>(Reason::kSolved);
    }
  }
  return field;
}

TEST(Undistorted, IsWhatThePinholeCameraWouldHave) {
  const Camera camera = BentCamera();
  const NormalField undistorted = Undistorted(FieldOf(camera), camera).value();
  const NormalField exact = FieldOf(PinholeOf(camera));
  int solved = 0;
  double worst = 0.0;
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      if (undistorted.reason.At(u, v) != static_cast<uint8_t>(Reason::kSolved)) {
        continue;
      }
      ++solved;
      double length = 0.0;
      const bool inner = u > 3 && v > 3 && u < 156 && v < 116;  // cubic: 16 pixels around
      for (size_t c = 0; c < 3; ++c) {
        const double n = undistorted.normal[c].At(u, v);
        length += n * n;
        if (inner) {
          worst = std::max(worst, std::abs(n - double(exact.normal[c].At(u, v))));
          EXPECT_NEAR(undistorted.albedo[c].At(u, v), exact.albedo[c].At(u, v), 1e-3);
        }
      }
      EXPECT_NEAR(length, 1.0, 1e-6);
      EXPECT_NEAR(undistorted.residual.At(u, v), exact.residual.At(u, v), 1e-5);
      EXPECT_EQ(undistorted.samples.At(u, v), 10);
    }
  }
  fmt::print("undistorted against the pinhole camera: normals within {:.2g}, {} of {} solved\n",
             worst, solved, 160 * 120);
  EXPECT_LT(worst, 4e-3);  // a cubic through waves of 20 px: (pi / 10)^4 / 10 of the amplitude
  // A barrel lens sees more than the pinhole camera, so all is seen.
  EXPECT_EQ(solved, 160 * 120);
}

TEST(Undistorted, PixelsWithoutSourcesHaveAReason) {
  Camera camera = BentCamera();
  NormalField field = FieldOf(camera);
  field.reason.At(80, 60) = static_cast<uint8_t>(Reason::kSaturated);
  const NormalField one = Undistorted(field, camera).value();
  int saturated = 0;
  for (size_t p = 0; p < one.reason.pixels.size(); ++p) {
    if (one.reason.pixels[p] == static_cast<uint8_t>(Reason::kSaturated)) {
      ++saturated;
      EXPECT_EQ(one.normal[2].pixels[p], 0.0F);
      EXPECT_EQ(one.albedo[0].pixels[p], 0.0F);
    }
  }
  EXPECT_GE(saturated, 1);
  EXPECT_LE(saturated, 9);  // pixels that a square of two pixels can touch under a mild zoom

  camera.distortion = {0.4, 0, 0, 0, 0};  // pincushion: the pinhole camera sees more
  const NormalField pin = Undistorted(FieldOf(camera), camera).value();
  EXPECT_EQ(pin.reason.At(0, 0), static_cast<uint8_t>(Reason::kOutsideMask));
  EXPECT_EQ(pin.normal[2].At(0, 0), 0.0F);
  EXPECT_EQ(pin.reason.At(80, 60), static_cast<uint8_t>(Reason::kSolved));
}

TEST(Undistorted, AReasonIsThatOfTheHeaviestNeighbour) {
  const Camera camera = BentCamera();
  NormalField field = FieldOf(camera);
  for (int v = 0; v < camera.size_px.height; ++v) {
    for (int u = 0; u < camera.size_px.width; ++u) {
      field.reason.At(u, v) = static_cast<uint8_t>(u % 2 == 0 ? Reason::kSaturated : Reason::kDark);
      field.samples.At(u, v) = u % 2 == 0 ? 1 : 2;
    }
  }

  const NormalField result = Undistorted(field, camera).value();

  // The heaviest neighbour is in the nearest column, and so is the one whose samples are taken.
  for (size_t p = 0; p < result.reason.pixels.size(); ++p) {
    const Reason expected = result.samples.pixels[p] == 1 ? Reason::kSaturated : Reason::kDark;
    ASSERT_EQ(result.reason.pixels[p], static_cast<uint8_t>(expected));
  }
}

TEST(Undistorted, WithoutDistortionNothingChanges) {
  Camera camera = BentCamera();
  camera.distortion = {};
  const NormalField field = FieldOf(camera);
  const NormalField same = Undistorted(field, camera).value();
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    ASSERT_NEAR(same.normal[0].pixels[p], field.normal[0].pixels[p], 1e-6);
    ASSERT_NEAR(same.albedo[1].pixels[p], field.albedo[1].pixels[p], 1e-6);
  }
  EXPECT_EQ(same.reason.pixels, field.reason.pixels);
  camera.size_px = {10, 10};
  EXPECT_THAT(Undistorted(field, camera).error().message,
              HasSubstr("160 x 120 px and a camera of 10"));
}

}  // namespace
}  // namespace sateen::undistort_test
