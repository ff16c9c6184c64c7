#include "simulation/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/angle.h"
#include "rig/projection.h"
#include "simulation/random.h"
#include "simulation/rigs.h"
#include "simulation/trace.h"

namespace sateen::render_test {
namespace {

using ::testing::HasSubstr;

Scene SceneOf(Result<SurfacePtr> surface, Rig rig) {
  EXPECT_TRUE(surface) << surface.error().message;
  Scene scene;
  scene.rig = std::move(rig);
  scene.surface = std::move(*surface);
  scene.materials.resize(scene.surface->Parts().size());
  return scene;
}

Light DistantLight(const Eigen::Vector3d& towards) {
  return {.name = "sun", .model = LightModel::kDistant, .direction = towards.normalized()};
}

Rig OneLight(ImageSize size, double width_mm, const Light& light) {
  Rig rig = RingRig(size, LightModel::kNear, width_mm);
  rig.lights = {light};
  return rig;
}

RenderedFrame Rendered(const Scene& scene, std::optional<size_t> light = 0, int threads = 0) {
  Result<SceneRenderer> renderer = SceneRenderer::Create(scene, {.threads = threads});
  EXPECT_TRUE(renderer) << renderer.error().message;
  Result<RenderedFrame> frame = renderer->Render(light, {.threads = threads});
  EXPECT_TRUE(frame) << frame.error().message;
  return std::move(*frame);
}

// A Lambertian sphere under a near light, from the ray's intersection with the sphere.
TEST(Render, LambertianSphereUnderANearLight) {
  const double radius = 40.0;
  const double edge = 60.0 * kRadPerDeg;
  const Light light{.name = "lamp",
                    .model = LightModel::kNear,
                    .position_mm = {150, -80, 300},
                    .flux_rgb = {0.2, 0.3, 0.4}};
  Scene scene = SceneOf(MakeSphereCap(radius, edge), OneLight({81, 61}, 100.0, light));
  scene.rig.camera->distortion = {-0.1, 0.05, 0.001, -0.001, 0.0};
  scene.materials[0].albedo = ConstantAlbedo{{0.9, 0.5, 0.1}};
  const RenderedFrame frame = Rendered(scene);
  const Eigen::Vector3d center(0, 0, -radius * std::cos(edge));
  int on_sphere = 0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 81; ++x) {
      const Eigen::Vector3d eye = scene.rig.camera->table_from_camera.translation();
      const Eigen::Vector3d ray = *RayOfPixel(*scene.rig.camera, x, y);
      const double b = ray.dot(eye - center);
      const double discriminant = b * b - (eye - center).squaredNorm() + radius * radius;
      Eigen::Vector3d at = *TablePointOfPixel(*scene.rig.camera, x, y);
      Eigen::Vector3d n = Eigen::Vector3d::UnitZ();
      if (discriminant > 0.0) {
        const Eigen::Vector3d hit = eye + (-b - std::sqrt(discriminant)) * ray;
        if (hit.z() > 0.0) {
          at = hit;
          n = (hit - center) / radius;
          ++on_sphere;
        }
      }
      const Eigen::Vector3d d = light.position_mm - at;
      const double cosine = std::max(0.0, n.dot(d) / d.norm());
      for (size_t c = 0; c < 3; ++c) {
        const auto i = static_cast<Eigen::Index>(c);
        const double rho = std::get<ConstantAlbedo>(scene.materials[0].albedo).rgb[i];
        const double expected = rho * light.flux_rgb[i] * 1e6 / d.squaredNorm() * cosine;
        EXPECT_NEAR(static_cast<double>(frame.radiance[c].At(x, y)), expected,
                    1e-5 * expected + 1e-12)
            << x << ' ' << y;
      }
    }
  }
  EXPECT_GT(on_sphere, 1500);
}

// The share of shadow in a pixel's column beside the edge, against the closed form of
// surface_test.cc for the left rim of a groove.
TEST(Render, CastShadowIsAntiAliased) {
  const double depth = 4.0;
  const double elevation = 45.0 * kRadPerDeg;
  const double half_width = depth * std::tan(30.0 * kRadPerDeg);
  const double steepness = depth / half_width;
  Scene scene =
      SceneOf(MakeGroove(depth, 60.0 * kRadPerDeg),
              OneLight({41, 5}, 8.0, DistantLight({-std::cos(elevation), 0, std::sin(elevation)})));
  scene.illumination = {.shadows = Shadows::kCast, .shadow_samples = 16};
  const Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  ASSERT_TRUE(renderer);
  const RenderedFrame frame = Rendered(scene);
  // Lit from here on; at 45 degrees and an opening of 60 the rim's shadow ends on the right wall.
  const double edge =
      (depth - half_width * std::tan(elevation)) / (steepness + std::tan(elevation));
  // The shadow's length across, by the lit shares of the middle row. Half of column 20, on the
  // bottom line, counts.
  const auto place = [&](int x) {
    return static_cast<double>(renderer->Maps().point_mm[0].At(x, 2));
  };
  double dark_mm = 0.5 * (place(21) - place(20));
  EXPECT_EQ(frame.lit.At(20, 2), 0);
  for (int x = 21; x < 40; ++x) {
    dark_mm += (1.0 - frame.lit.At(x, 2) / 255.0) * 0.5 * (place(x + 1) - place(x - 1));
  }
  EXPECT_NEAR(dark_mm, edge,
              0.015 * edge);  // a binary mask of these 0.2 mm pixels: up to 16 %
  scene.illumination.shadows = Shadows::kAttached;
  EXPECT_NE(Rendered(scene).radiance[0].At(21, 2), frame.radiance[0].At(21, 2));
}

// Two perpendicular walls under vertical light: a wall of uniform radiosity B and slant height w
// sends rho B F to a point of the other at distance s from the corner, where
// F = (1 - s / sqrt(s^2 + w^2)) / 2.
TEST(Render, OneBounceBetweenPerpendicularWalls) {
  const double depth = 10.0;
  const double slant = depth * std::numbers::sqrt2;
  const double rho = 0.8;
  Scene scene = SceneOf(MakeGroove(depth, std::numbers::pi / 2),
                        OneLight({41, 3}, 16.0, DistantLight({0, 0, 1})));
  scene.materials[0].albedo = ConstantAlbedo{Eigen::Vector3d::Constant(rho)};
  const RenderedFrame direct = Rendered(scene);
  scene.illumination.bounce_rays = 10000;
  const Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  ASSERT_TRUE(renderer);
  const RenderedFrame both = Rendered(scene);
  for (int x = 0; x < 41; ++x) {
    const double s =
        std::abs(static_cast<double>(renderer->Maps().point_mm[0].At(x, 1))) * std::numbers::sqrt2;
    if (s < 0.5) {
      continue;  // at the corner rays start within a step of the other wall
    }
    const double radiosity = rho * std::numbers::sqrt2 / 2.0;
    const double expected = rho * radiosity * 0.5 * (1.0 - s / std::hypot(s, slant));
    const double found = static_cast<double>(both.radiance[0].At(x, 1)) -
                         static_cast<double>(direct.radiance[0].At(x, 1));
    // 10,000 stratified rays, an indicator function: standard error about 1e4^-3/4 = 1e-3 of B.
    EXPECT_NEAR(found, expected, 4e-3 * radiosity * rho) << s;
  }
}

TEST(Render, AmbientFillsTheDarkFrameAndDeadLightsAddNothing) {
  Scene scene = SceneOf(MakePlane(0, 0), RingRig({16, 12}));
  scene.materials[0].albedo = ConstantAlbedo{{0.5, 0.5, 0.25}};
  scene.illumination.ambient_rgb = {0.1, 0.2, 0.4};
  scene.illumination.dead = {scene.rig.lights[3].name};
  const RenderedFrame dark = Rendered(scene, std::nullopt);
  EXPECT_FLOAT_EQ(dark.radiance[0].At(3, 3), 0.05F);
  EXPECT_FLOAT_EQ(dark.radiance[1].At(3, 3), 0.1F);
  EXPECT_FLOAT_EQ(dark.radiance[2].At(3, 3), 0.1F);
  EXPECT_EQ(Rendered(scene, 3).radiance[1].pixels, dark.radiance[1].pixels);
  EXPECT_GT(Rendered(scene, 4).radiance[1].At(3, 3), 0.2F);
}

TEST(Render, ShadowsNoneKeepsTheLinearModel) {
  Scene scene =
      SceneOf(MakePlane(60.0 * kRadPerDeg, 0.0), OneLight({8, 8}, 20.0, DistantLight({1, 0, 0.2})));
  const double cosine = Eigen::Vector3d(-std::sin(std::numbers::pi / 3), 0, 0.5)
                            .dot(Eigen::Vector3d(1, 0, 0.2).normalized());
  EXPECT_EQ(Rendered(scene).radiance[0].At(4, 4), 0.0F);
  EXPECT_EQ(Rendered(scene).lit.At(4, 4), 0);
  scene.illumination.shadows = Shadows::kNone;
  EXPECT_NEAR(static_cast<double>(Rendered(scene).radiance[0].At(4, 4)), 0.5 * cosine, 1e-7);
}

TEST(Render, FlickerChangesEachLightByItsOwnFactor) {
  Scene scene = SceneOf(MakePlane(0, 0), RingRig({8, 6}));
  std::vector<double> factors;
  for (size_t k = 0; k < 10; ++k) {
    scene.illumination.flicker = 0.0;
    const RenderedFrame steady = Rendered(scene, k);
    scene.illumination.flicker = 0.02;
    factors.push_back(static_cast<double>(Rendered(scene, k).radiance[0].At(0, 0)) /
                      static_cast<double>(steady.radiance[0].At(0, 0)));
    EXPECT_NEAR(factors.back(), 1.0, 0.08);
  }
  EXPECT_GT(*std::ranges::max_element(factors) - *std::ranges::min_element(factors), 0.02);
}

TEST(Render, BumpMovesThePictureByItsPixels) {
  Scene scene = SceneOf(MakeWaves(20.0, 0.5), RingRig({40, 30}));
  scene.materials[0].albedo = WavyAlbedo{.period_mm = 30.0};
  const RenderedFrame before = Rendered(scene, 5);
  scene.lens.bump_from = scene.rig.lights[5].name;
  scene.lens.bump_px = {2.0, -3.0};
  const RenderedFrame after = Rendered(scene, 5);
  for (int y = 0; y < 27; ++y) {
    for (int x = 2; x < 40; ++x) {
      EXPECT_NEAR(after.radiance[1].At(x, y), before.radiance[1].At(x - 2, y + 3), 1e-6);
    }
  }
  const RenderedFrame earlier = Rendered(scene, 4);
  scene.lens.bump_from = "";
  EXPECT_EQ(earlier.radiance[0].pixels, Rendered(scene, 4).radiance[0].pixels);
}

TEST(Render, LensSpreadsAPointAndDarkensCorners) {
  Scene scene = SceneOf(MakePlane(0, 0), OneLight({101, 81}, 100.0, DistantLight({0, 0, 1})));
  scene.lens.vignetting = {-0.4, 0.1, 0.0};
  const RenderedFrame frame = Rendered(scene);
  EXPECT_FLOAT_EQ(frame.radiance[0].At(50, 40), 0.5F);
  EXPECT_FLOAT_EQ(frame.radiance[0].At(0, 0), 0.5F * 0.7F);
  scene.lens.vignetting = {};
  scene.lens.psf_sigma_px = 2.0;
  scene.materials[0].albedo = PrintAlbedo{
      .print = PrintOf({.columns = 2, .rows = 2, .square_mm = 1000.0}), .dark = 0.0, .light = 1.0};
  const RenderedFrame edge = Rendered(scene);
  // An edge blurred by a Gaussian is its distribution function: pixel d + 1/2 off at d = 0, 1 ...
  // The table's x = 0 lies in the middle of pixel 50, which lies right of the edge.
  for (int d = 0; d < 6; ++d) {
    const double expected = 0.5 * std::erfc(-(d + 0.5) / (2.0 * std::numbers::sqrt2));
    EXPECT_NEAR(static_cast<double>(edge.radiance[0].At(50 + d, 10)) +
                    static_cast<double>(edge.radiance[0].At(49 - d, 10)),
                1.0, 1e-5);
    const auto higher = static_cast<double>(
        std::max(edge.radiance[0].At(50 + d, 10), edge.radiance[0].At(49 - d, 10)));
    EXPECT_NEAR(higher, expected, 5e-3) << d;
  }
}

TEST(Render, SameBitsOnAnyNumberOfThreads) {
  Scene scene = SceneOf(MakeWaves(10.0, 0.8), RingRig({50, 40}));
  scene.illumination = {.shadows = Shadows::kCast, .bounce_rays = 16};
  scene.lens.psf_sigma_px = 0.7;
  const RenderedFrame one = Rendered(scene, 2, 1);
  const RenderedFrame three = Rendered(scene, 2, 3);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(one.radiance[c].pixels, three.radiance[c].pixels);
  }
  EXPECT_EQ(one.lit.pixels, three.lit.pixels);
}

TEST(Scene, ErrorsNameTheKeyAndItsRange) {
  const auto message = [](const auto& spoil) {
    Scene scene = SceneOf(MakePlane(0, 0), RingRig({8, 6}));
    spoil(scene);
    const Status status = scene.Validate();
    return status ? std::string("valid") : status.error().message;
  };
  EXPECT_THAT(message([](Scene& s) {
                s.materials[0].albedo = ConstantAlbedo{{0.5, -0.1, 0.5}};
              }),
              HasSubstr("materials.surface.albedo = -0.1; need 0 to 1"));
  EXPECT_THAT(message([](Scene& s) { s.illumination.flicker = 0.5; }),
              HasSubstr("illumination.flicker = 0.5; need 0 to 0.2"));
  EXPECT_THAT(message([](Scene& s) { s.illumination.dead = {"led-77"}; }),
              HasSubstr("'led-77' is no light of the rig; need one of led-0, "));
  EXPECT_THAT(message([](Scene& s) { s.lens.psf_sigma_px = -1; }), HasSubstr("lens.psf_sigma_px"));
  EXPECT_THAT(message([](Scene& s) {
                s.lens.vignetting = {-1.5, 0, 0};
              }),
              HasSubstr("lens.vignetting"));
  EXPECT_THAT(message([](Scene& s) { s.surface = std::move(*MakeSphereCap(2000.0, 1.4)); }),
              HasSubstr("the camera is at z = 610 mm, inside or below the sample"));
  EXPECT_THAT(message([](Scene& s) { s.surface = std::move(*MakeSphereCap(620.0, 1.5)); }),
              HasSubstr("light 'led-0' is at z"));
}

}  // namespace
}  // namespace sateen::render_test
