#include "calibration/spheres/spheres.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "rig/projection.h"
#include "tests/calibration/synthetic_spheres.h"

namespace sateen::spheres_test {
namespace {

using ::testing::HasSubstr;

using sateen::testing::AngleDeg;
using sateen::testing::Centers;
using sateen::testing::kRadiusMm;
using sateen::testing::Mirrored;
using sateen::testing::RenderSpheres;
using sateen::testing::SphereCamera;

std::vector<Sphere> SpheresOf(const Image<float>& gray, const std::optional<Camera>& camera) {
  std::vector<Sphere> spheres;
  spheres.reserve(2);
  const std::vector<Circle> circles = FindCircles(gray, 2, "mean").value();
  for (const Circle& circle : circles) {
    spheres.push_back(
        FindSphere(gray, circle, "mean", {.camera = camera, .radius_mm = kRadiusMm}).value());
  }
  return spheres;
}

TEST(Spheres, StandWhereTheyAre) {
  const std::vector<Sphere> spheres = SpheresOf(RenderSpheres({}), SphereCamera());

  for (size_t i = 0; i < 2; ++i) {
    EXPECT_LT((spheres[i].center - Centers()[i]).head<2>().norm(), 0.01) << i;
    EXPECT_NEAR(spheres[i].center.z(), 30.0, 0.2) << i;  // depth is 5.6 times as hard as width
    EXPECT_GT(spheres[i].seen, 0.99);
  }
}

TEST(Spheres, AMaskGivesThemToo) {
  const Camera camera = SphereCamera();
  const Eigen::Vector3d origin = camera.table_from_camera.translation();
  Mask mask(camera.size_px);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      const Eigen::Vector3d ray = RayOfPixel(camera, x, y).value();
      mask.At(x, y) = std::ranges::any_of(Centers(),
                                          [&](const Eigen::Vector3d& center) {
                                            return Mirrored(origin, ray, center, {}).has_value();
                                          })
                          ? 255
                          : 0;
    }
  }

  const std::vector<Circle> circles = CirclesInMask(mask, 2, "mask.png").value();

  for (const Circle& circle : circles) {
    const Sphere sphere = FindSphere(AsPhotograph(mask), circle, "mask.png",
                                     {.camera = SphereCamera(), .radius_mm = kRadiusMm})
                              .value();
    const bool left = circle.center_px.x() < 750.0;
    EXPECT_LT((sphere.center - Centers()[left ? 0 : 1]).head<2>().norm(), 0.03);
  }
  EXPECT_THAT(CirclesInMask(mask, 1, "mask.png").error().message,
              HasSubstr("mask.png: 2 regions; need 1"));
}

// Directions from each sphere, positions from both, lamps low and high, exact and saturated. The
// classic mistake, the normal for the light, and v = z are both far outside what is allowed.
TEST(Spheres, DirectionsAndPositions) {
  const Camera camera = SphereCamera();
  const std::vector<Sphere> spheres = SpheresOf(RenderSpheres({}), camera);
  double worst_deg = 0.0;
  double worst_mm = 0.0;
  for (const double exposure : {0.9, 4.0}) {
    for (const Eigen::Vector3d& lamp :
         {Eigen::Vector3d(250, 100, 500), Eigen::Vector3d(-400, 50, 300),
          Eigen::Vector3d(60, -300, 450)}) {
      const Image<float> frame = RenderSpheres({lamp}, exposure);
      std::vector<SphereRay> rays;
      rays.reserve(2);
      for (const Sphere& sphere : spheres) {
        const Highlight highlight = FindHighlight(frame, sphere, "frame").value();
        rays.push_back(ReflectedRay(sphere, camera, highlight.at_px).value());
        const Eigen::Vector3d truth = lamp - rays.back().from;
        EXPECT_LT(AngleDeg(rays.back().direction, truth), 0.05);
        worst_deg = std::max(worst_deg, AngleDeg(rays.back().direction, truth));

        const Eigen::Vector3d normal = rays.back().from - sphere.center;
        EXPECT_GT(AngleDeg(normal, truth), 10.0);
        const Eigen::Vector3d n = normal.normalized();
        EXPECT_GT(AngleDeg(2.0 * n.z() * n - Eigen::Vector3d::UnitZ(), truth), 1.0);
      }
      const SphereLight light = LightFromRays(rays, true, "frame").value();
      ASSERT_EQ(light.light.model, LightModel::kNear);
      worst_mm = std::max(worst_mm, (light.light.position_mm - lamp).norm());
      EXPECT_LT((light.light.position_mm - lamp).norm(), 2.0);
      EXPECT_LT(light.residual_rad, 0.05 * kRadPerDeg);
      EXPECT_GT(light.position_sd_mm->minCoeff(), 0.0);

      EXPECT_EQ(LightFromRays({rays[0]}, true, "frame")->light.model, LightModel::kDistant);
    }
  }
  fmt::print("simulated: worst direction {:.3f} degrees, worst position {:.2f} mm\n", worst_deg,
             worst_mm);
}

// A brushed sphere draws a streak from the lamp's image to one side, nearly as bright and a fifth
// of the radius long. It may turn the light by no more than a pixel, 0.8 degrees; the blob's
// centroid, at the same level as the window, turns it by more.
TEST(Spheres, AStreakDoesNotDrawTheHighlight) {
  const Sphere sphere = SphereFromCircle({{200.0, 200.0}, 150.0}, {400, 400}, "frame").value();
  Image<float> frame(400, 400, 0.02F);
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();
  double light = 0.0;
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 400; ++x) {
      const double lamp = 3.0 * std::exp(-(std::pow(x - 170.3, 2) + std::pow(y - 230.6, 2)) / 18.0);
      const bool in_streak = x > 170 && x < 200 && std::abs(y - 230 - (x - 170) / 3) <= 2;
      frame.At(x, y) = std::min(1.0F, 0.02F + static_cast<float>(lamp) + (in_streak ? 0.93F : 0));
      const double above = std::max(0.0F, frame.At(x, y) - 0.51F);
      centroid += above * Eigen::Vector2d(x, y);
      light += above;
    }
  }

  const Highlight highlight = FindHighlight(frame, sphere, "frame").value();

  EXPECT_LT((highlight.at_px - Eigen::Vector2d(170.3, 230.6)).norm(), 1.0);
  EXPECT_GT((centroid / light - Eigen::Vector2d(170.3, 230.6)).norm(), 2.0);
}

TEST(Spheres, AFarLampStaysADirection) {
  const Eigen::Vector3d away = Eigen::Vector3d(1, 2, 3).normalized();
  const std::vector<SphereRay> rays = {{Centers()[0], away}, {Centers()[1], away}};

  const SphereLight light = LightFromRays(rays, true, "frame").value();

  EXPECT_EQ(light.light.model, LightModel::kDistant);
  EXPECT_LT(AngleDeg(light.light.direction, away), 1e-6);
}

TEST(Spheres, ErrorsNameTheFrame) {
  const Camera camera = SphereCamera();
  const Image<float> dark = RenderSpheres({});
  const std::vector<Sphere> spheres = SpheresOf(dark, camera);
  EXPECT_THAT(FindHighlight(dark, spheres[0], "07.png").error().message,
              HasSubstr("07.png: no highlight in the sphere at"));

  const Image<float> two = RenderSpheres({{250, 100, 500}, {-250, 100, 500}});
  EXPECT_THAT(FindHighlight(two, spheres[0], "08.png").error().message,
              HasSubstr("08.png: two highlights alike in one sphere"));

  Image<float> cut(600, 900);  // the right sphere loses its right part... and the left its left
  for (int y = 0; y < cut.height; ++y) {
    for (int x = 0; x < cut.width; ++x) {
      cut.At(x, y) = dark.At(x + 300, y);
    }
  }
  const Circle half{{spheres[0].outline.center_px.x() - 300.0, spheres[0].outline.center_px.y()},
                    spheres[0].outline.radius_px};
  EXPECT_THAT(FindSphere(cut, half, "09.png").error().message,
              HasSubstr("is cut by the frame of 600 x 900 px"));

  EXPECT_THAT(FindCircles(Image<float>({300, 300}, 0.2F), 1, "10.png").error().message,
              HasSubstr("10.png: 0 of 1 spheres stand out"));
  EXPECT_THAT(ReflectedRay(spheres[0], camera, {5.0, 5.0}).error().message,
              HasSubstr("is not on the sphere"));
  const std::vector<SphereRay> askew = {{{0, 0, 0}, Eigen::Vector3d::UnitX()},
                                        {{0, 80, 0}, Eigen::Vector3d::UnitZ()}};
  EXPECT_THAT(LightFromRays(askew, true, "11.png").error().message,
              HasSubstr("11.png: the rays of 2 spheres miss one lamp"));
  EXPECT_THAT(FindSphere(dark, half, "12.png", {.camera = camera}).error().message,
              HasSubstr("radius_mm = 0; need"));
}

}  // namespace
}  // namespace sateen::spheres_test
