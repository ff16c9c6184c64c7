// Effects of a scene, each against a closed form of its own.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/angle.h"
#include "reflectance/specular.h"
#include "rig/projection.h"
#include "simulation/optics.h"
#include "simulation/render.h"
#include "simulation/rigs.h"

namespace sateen::render_effects_test {
namespace {

Scene SceneOf(Result<SurfacePtr> surface, Rig rig) {
  EXPECT_TRUE(surface) << surface.error().message;
  Scene scene;
  scene.rig = std::move(rig);
  scene.surface = std::move(*surface);
  scene.materials.resize(scene.surface->Parts().size());
  return scene;
}

Rig Under(ImageSize size, double width_mm, const Light& light) {
  Rig rig = RingRig(size, LightModel::kNear, width_mm);
  rig.lights = {light};
  return rig;
}

Light Sun(const Eigen::Vector3d& towards) {
  return {.name = "sun", .model = LightModel::kDistant, .direction = towards.normalized()};
}

PrintAlbedo Chess(int columns, int rows, double square_mm, double dark, double light) {
  return {.print = PrintOf({.columns = columns, .rows = rows, .square_mm = square_mm}),
          .dark = dark,
          .light = light};
}

RenderedFrame FrameOf(const Scene& scene) {
  Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  EXPECT_TRUE(renderer) << renderer.error().message;
  return renderer->Render(0).value();
}

double Red(const RenderedFrame& frame, int x, int y) {
  return static_cast<double>(frame.radiance[0].At(x, y));
}

TEST(Effects, SpecularIsPiTimesItsBrdfForTheViewersDirection) {
  const Light light{.name = "lamp",
                    .model = LightModel::kNear,
                    .position_mm = {-120, 60, 400},
                    .flux_rgb = {0.3, 0.3, 0.3}};
  Scene scene = SceneOf(MakePlane(0, 0), Under({41, 31}, 200.0, light));
  scene.materials[0].albedo = ConstantAlbedo{Eigen::Vector3d::Constant(0.2)};
  const Ggx ggx({.f0 = Eigen::Vector3d::Constant(0.3), .alpha = 0.4});
  scene.materials[0].specular = std::make_shared<const Ggx>(ggx);
  const RenderedFrame frame = FrameOf(scene);
  const Eigen::Vector3d eye = scene.rig.camera->table_from_camera.translation();
  for (const int x : {0, 12, 40}) {
    const Eigen::Vector3d at = *TablePointOfPixel(*scene.rig.camera, x, 5);
    const Eigen::Vector3d d = light.position_mm - at;
    const Eigen::Vector3d f =
        ggx.Evaluate(Eigen::Vector3d::UnitZ(), d.normalized(), (eye - at).normalized());
    const double expected =
        (0.2 + std::numbers::pi * f[0]) * 0.3 * 1e6 / d.squaredNorm() * d.z() / d.norm();
    EXPECT_NEAR(Red(frame, x, 5), expected, 1e-5 * expected) << x;
  }
}

TEST(Effects, VignettingIsAPolynomialInTheSquaredRadius) {
  Image3 flat({101, 1}, 1.0F);
  ASSERT_TRUE(ApplyOptics({.vignetting = {-0.4, 0.2, -0.1}}, flat));
  for (const int x : {50, 75, 90, 100}) {
    const double r2 = std::pow((x - 50) / 50.0, 2);
    EXPECT_NEAR(static_cast<double>(flat[1].At(x, 0)),
                1.0 - 0.4 * r2 + 0.2 * r2 * r2 - 0.1 * r2 * r2 * r2, 1e-6)
        << x;
  }
}

TEST(Effects, PointSpreadIsTheSameGaussianAlongXAndY) {
  constexpr double kSigma = 1.7;
  Image3 point({41, 41});
  point[0].At(20, 20) = 1.0F;
  ASSERT_TRUE(ApplyOptics({.psf_sigma_px = kSigma}, point));
  double sum = 0.0;
  for (const float value : point[0].pixels) {
    sum += static_cast<double>(value);
  }
  EXPECT_NEAR(sum, 1.0, 1e-5);
  const double peak = static_cast<double>(point[0].At(20, 20));
  EXPECT_NEAR(peak, 1.0 / (2.0 * std::numbers::pi * kSigma * kSigma), 1e-4);
  for (const int d : {1, 3, 5}) {
    const double expected = peak * std::exp(-0.5 * d * d / (kSigma * kSigma));
    EXPECT_NEAR(static_cast<double>(point[0].At(20 + d, 20)), expected, 1e-6) << d;
    EXPECT_NEAR(static_cast<double>(point[0].At(20, 20 - d)), expected, 1e-6) << d;
  }
}

TEST(Effects, EveryTextureHasItsValueInItsPlace) {
  PrintAlbedo chess = Chess(4, 2, 10.0, 0.1, 0.8);
  EXPECT_EQ(AlbedoAt(chess, -15, 5)[0], 0.1);  // the corner at low x, high y: the top left one
  EXPECT_EQ(AlbedoAt(chess, -5, 5)[0], 0.8);
  EXPECT_EQ(AlbedoAt(chess, -5, -5)[0], 0.1);
  EXPECT_EQ(AlbedoAt(chess, -25, 5)[0], 0.8);  // outside
  chess.beyond = 0.3;
  EXPECT_EQ(AlbedoAt(chess, -25, 5)[0], 0.3);
  const PatchesAlbedo patches{.values = {0.9, 0.5}, .patch_mm = 10};
  EXPECT_EQ(AlbedoAt(patches, -5, 0)[1], 0.9);
  EXPECT_EQ(AlbedoAt(patches, 5, 0)[1], 0.5);
  EXPECT_EQ(AlbedoAt(patches, 5, 6)[1], 0.18);
  const WavyAlbedo wavy{.min = 0.2, .max = 0.6, .period_mm = 8};
  EXPECT_NEAR(AlbedoAt(wavy, 1, 1)[0], 0.2 + 0.4 * (0.5 + 0.5 * 1.0), 1e-12);
}

// One pixel half over a light square, half over a dark one.
TEST(Effects, SamplesAverageAlbedoOverThePixel) {
  Scene scene = SceneOf(MakePlane(0, 0), Under({3, 2}, 3.0, Sun({0, 0, 1})));
  scene.materials[0].albedo = Chess(2, 2, 50.0, 0.0, 1.0);
  EXPECT_EQ(std::abs(Red(FrameOf(scene), 1, 0) - 0.5), 0.5);
  scene.lens.samples = 8;
  EXPECT_NEAR(Red(FrameOf(scene), 1, 0), 0.5, 1e-6);  // the edge x = 0 halves it
  scene.rig.camera->cx += 0.25;                       // seen a quarter of a pixel beside
  EXPECT_NEAR(std::abs(Red(FrameOf(scene), 1, 0) - 0.5), 0.25, 1e-6);
}

// The corners of the squares of a print that lies tilted, turned and beside the middle are where
// its frame says, as far from each other on the slope as on paper.
TEST(Effects, APrintLiesInThePlaneUndistorted) {
  const double slope_rad = 0.6;
  PrintAlbedo chess = Chess(4, 4, 10.0, 0.0, 1.0);
  chess.table_from_print = Eigen::Translation3d(7.0, -3.0, 2.0) *
                           Eigen::AngleAxisd(slope_rad, Eigen::Vector3d(0.6, 0.8, 0.0)) *
                           Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ());
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      for (int corner = 0; corner < 4; ++corner) {  // just within the square's corners
        const Eigen::Vector3d at(-20.0 + 10.0 * column + (corner % 2 == 0 ? 0.01 : 9.99),
                                 20.0 - 10.0 * row - (corner < 2 ? 0.01 : 9.99), 0.0);
        const Eigen::Vector3d on_table = chess.table_from_print * at;
        EXPECT_EQ(AlbedoAt(chess, on_table.x(), on_table.y())[0], (column + row) % 2)
            << column << ' ' << row;
      }
    }
  }
}

TEST(Effects, FlickerHasItsDeviation) {
  Scene scene = SceneOf(MakePlane(0, 0), Under({2, 2}, 10.0, Sun({0, 0, 1})));
  scene.materials[0].albedo = ConstantAlbedo{Eigen::Vector3d::Ones()};
  scene.illumination.flicker = 0.1;
  constexpr int kSeeds = 2000;
  double sum = 0.0;
  double squares = 0.0;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    scene.seed = seed;
    const double gain = Red(FrameOf(scene), 0, 0);
    sum += gain / kSeeds;
    squares += gain * gain / kSeeds;
  }
  EXPECT_NEAR(sum, 1.0, 0.01);
  EXPECT_NEAR(std::sqrt(squares - sum * sum), 0.1, 0.006);  // uncertain by 1.6 %
}

TEST(Effects, EachYarnHasAnAlbedoOfItsOwnWithinTheVariation) {
  Result<SurfacePtr> weave = MakeWaves(1e3, 0.0);
  ASSERT_TRUE(weave);
  Scene scene = SceneOf(std::move(weave), Under({4, 4}, 10.0, Sun({0, 0, 1})));
  scene.materials[0].yarn_variation = 0.5;
  double lowest = 1.0;
  double highest = 0.0;
  for (scene.seed = 0; scene.seed < 50; ++scene.seed) {
    const double albedo = Red(FrameOf(scene), 0, 0);
    lowest = std::min(lowest, albedo);
    highest = std::max(highest, albedo);
  }
  EXPECT_GE(lowest, 0.25 - 1e-6);
  EXPECT_LT(lowest, 0.32);
  EXPECT_LE(highest, 0.75 + 1e-6);
  EXPECT_GT(highest, 0.68);
}

// A groove lit along x from low: the left wall lies in attached shadow, the right one is lit where
// the left rim lets light pass. What the left wall sees is the lit part of the right wall, with its
// albedo.
TEST(Effects, ABounceComesFromWhatIsLitWithTheAlbedoThere) {
  const double depth = 10.0;  // walls at 45 degrees
  Scene scene = SceneOf(MakeGroove(depth, std::numbers::pi / 2),
                        Under({41, 2}, 16.0, Sun({-std::cos(0.3), 0, std::sin(0.3)})));
  // Left of x = 0 albedo 1, right of it 0.2: two squares in the middle row of three.
  scene.materials[0].albedo = Chess(2, 3, 500.0, 0.2, 1.0);
  scene.illumination = {.shadows = Shadows::kCast, .bounce_rays = 4900};
  const RenderedFrame frame = FrameOf(scene);
  const Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  ASSERT_TRUE(renderer);
  // Lit is the right wall above z where the ray over the left rim (-depth, 0) meets it: x = z +
  // depth.
  const double slope = std::tan(0.3);
  const double x_low = depth * (1.0 - slope) / (1.0 + slope);
  const double from = x_low * std::numbers::sqrt2;  // along the wall, from the corner
  const double to = depth * std::numbers::sqrt2;
  for (int x = 2; x < 15; x += 4) {
    const double at = static_cast<double>(renderer->Maps().point_mm[0].At(x, 0));
    ASSERT_LT(at, 0.0);
    const double s = -at * std::numbers::sqrt2;
    const double albedo_here = static_cast<double>(renderer->Maps().albedo[0].At(x, 0));
    const double albedo_there = 1.2 - albedo_here;
    // Perpendicular strips: F = (cos a - cos b) / 2 with cos = s / sqrt(s^2 + w^2).
    const double form = 0.5 * (s / std::hypot(s, from) - s / std::hypot(s, to));
    // The right wall's normal is (-1, 0, 1) / sqrt 2.
    const double cosine = (std::cos(0.3) + std::sin(0.3)) / std::numbers::sqrt2;
    const double expected = albedo_here * albedo_there * cosine * form;
    EXPECT_NEAR(Red(frame, x, 0), expected, 6e-3 * albedo_here * albedo_there * cosine) << at;
    EXPECT_EQ(frame.lit.At(x, 0), 0);
  }
}

// A stair whose edge runs along y throws a shadow from a lamp that is near: its length is that of
// similar triangles.
TEST(Effects, NearLightsThrowShadowsFromWhereTheyAre) {
  const double rise = 5.0;
  const Light lamp{.name = "lamp",
                   .model = LightModel::kNear,
                   .position_mm = {120, 0, 65},
                   .flux_rgb = {0.3, 0.3, 0.3}};
  Scene scene = SceneOf(MakeSteps(1, 10.0, rise, 0.05), Under({401, 3}, 60.0, lamp));
  scene.illumination = {.shadows = Shadows::kCast, .shadow_samples = 4};
  Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  ASSERT_TRUE(renderer);
  const RenderedFrame frame = renderer->Render(0).value();
  const Image3& at = renderer->Maps().point_mm;
  // The top edge: the first point from the left that is at the highest level.
  const double top = scene.surface->HighestMm();
  double edge = 0.0;
  double dark_until = 0.0;
  int y = 1;
  for (int x = 0; x < 401; ++x) {
    if (static_cast<double>(at[2].At(x, y)) > top - 1e-3) {
      edge = static_cast<double>(at[0].At(x, y));
      break;
    }
    if (frame.lit.At(x, y) > 128 && static_cast<double>(at[2].At(x, y)) < top - rise + 1e-3) {
      dark_until = static_cast<double>(at[0].At(x, y));
    }
  }
  // From the lamp over the edge down to the tread: no shadow on the side of the lamp, so the stair
  // must rise towards it.
  const double height = lamp.position_mm.z() - top;
  const double length = rise * (lamp.position_mm.x() - edge) / height;
  EXPECT_NEAR(edge - dark_until, length, 0.4);
}

TEST(Effects, APlaneThatARayNeverMeetsIsRefused) {
  Scene scene = SceneOf(MakePlane(85.0 * kRadPerDeg, 0.0), Under({40, 30}, 200.0, Sun({0, 0, 1})));
  const Result<SceneRenderer> renderer = SceneRenderer::Create(scene);
  ASSERT_FALSE(renderer);
  EXPECT_EQ(renderer.error().code, ErrorCode::kBadData);
  Scene cliff = SceneOf(MakeSteps(1, 10, 1, 1e-6), Under({40, 30}, 200.0, Sun({0, 0, 1})));
  EXPECT_FALSE(SceneRenderer::Create(cliff));
}

}  // namespace
}  // namespace sateen::render_effects_test
