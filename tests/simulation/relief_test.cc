#include "simulation/relief.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/angle.h"
#include "simulation/rigs.h"

namespace sateen::relief_test {
namespace {

using ::testing::HasSubstr;

TEST(RenderRelief, FlatUnderOneNearLightFollowsTheInverseSquare) {
  Rig rig = RingRig({5, 5});
  rig.lights = {{.name = "a",
                 .model = LightModel::kNear,
                 .position_mm = Eigen::Vector3d(0.0, 0.0, 500.0),
                 .flux_rgb = Eigen::Vector3d(1.0, 0.5, 0.25)}};
  const ReliefScene scene{.shape = ReliefShape::kFlat, .albedo_min = 0.5, .albedo_max = 0.5};

  const RenderedRelief relief = RenderRelief(scene, rig, {5, 5}).value();

  // Centre: 0.5 phi (1000 / 500)^2. Corner: 80 mm off both ways (200 mm across 5 px), and by
  // cos = 500 / d: 0.5 phi 1e6 * 500 / d^3.
  EXPECT_FLOAT_EQ(relief.stack[0].rgb[0].At(2, 2), 2.0F);
  EXPECT_FLOAT_EQ(relief.stack[0].rgb[1].At(2, 2), 1.0F);
  const double d_mm = std::sqrt(500.0 * 500.0 + 2.0 * 80.0 * 80.0);
  EXPECT_NEAR(relief.stack[0].rgb[2].At(0, 4), 0.25 * 0.5e6 * 500.0 / std::pow(d_mm, 3), 1e-6);
}

TEST(RenderRelief, DomeTiltsOutwardsAndReachesItsSlopeAtTheRim) {
  const ReliefScene scene{.shape = ReliefShape::kDome, .max_slope_rad = 60.0 * kRadPerDeg};
  Rig rig;
  rig.lights = DistantRing(3, 0.5);

  const RenderedRelief relief = RenderRelief(scene, rig, {101, 101}).value();

  EXPECT_EQ(relief.normal[2].At(50, 50), 1.0F);
  EXPECT_GT(relief.normal[0].At(90, 50), 0.5F);  // right of the centre: tilted to the right
  EXPECT_GT(relief.normal[1].At(50, 10), 0.5F);  // above the centre: tilted up
  EXPECT_NEAR(relief.normal[0].At(100, 50), std::sin(60.0 * kRadPerDeg) * 50.0 / 50.5, 1e-6);
  EXPECT_EQ(relief.normal[2].At(0, 0), 1.0F);  // outside the circle: level
}

TEST(RenderRelief, NoLightReachesAFacetThatTurnsAway) {
  const ReliefScene scene{.shape = ReliefShape::kDome, .max_slope_rad = 80.0 * kRadPerDeg};
  Rig rig;
  rig.lights = {{.direction = Eigen::Vector3d(std::sin(0.8), 0.0, std::cos(0.8))}};

  const RenderedRelief relief = RenderRelief(scene, rig, {101, 101}).value();

  EXPECT_EQ(relief.stack[0].rgb[0].At(2, 50), 0.0F);
  EXPECT_GT(relief.stack[0].rgb[0].At(98, 50), 0.1F);
}

TEST(RenderRelief, SensorNoiseHasTheVarianceOfItsElectrons) {
  ReliefScene scene{.shape = ReliefShape::kFlat, .albedo_min = 0.4, .albedo_max = 0.4};
  scene.sensor = SensorModel{.full_scale = 2.0, .bits = 16, .electrons = 10000.0};
  Rig rig;
  rig.lights = {{.direction = Eigen::Vector3d::UnitZ()}};
  const ImageSize size{400, 300};

  const RenderedRelief relief = RenderRelief(scene, rig, size).value();

  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (const float value : relief.stack[0].rgb[1].pixels) {
    const double electrons = static_cast<double>(value) / 2.0 * 10000.0;
    sum += electrons;
    sum_of_squares += electrons * electrons;
  }
  const auto n = static_cast<double>(size.PixelCount());
  const double mean = sum / n;
  const double variance = sum_of_squares / n - mean * mean;
  // 0.4 / 2 * 10000 = 2000 electrons, shot variance 2000, read 4^2. Over 120,000 samples the
  // mean is known to 0.13 and the variance to 0.4 %: bounds are four and five times that.
  EXPECT_NEAR(mean, 2000.0, 0.55);
  EXPECT_NEAR(variance, 2016.0, 0.02 * 2016.0);
}

TEST(RenderRelief, SensorSaturatesAtFullScale) {
  ReliefScene scene{.shape = ReliefShape::kFlat, .albedo_min = 0.9, .albedo_max = 0.9};
  scene.sensor = SensorModel{.full_scale = 0.5};
  Rig rig;
  rig.lights = {{.direction = Eigen::Vector3d::UnitZ()}};

  const RenderedRelief relief = RenderRelief(scene, rig, {8, 8}).value();

  EXPECT_EQ(relief.stack[0].full_scale, 0.5F);
  for (const float value : relief.stack[0].rgb[0].pixels) {
    EXPECT_EQ(value, 0.5F);
  }
}

TEST(RenderRelief, NoiseDependsOnTheSeedAlone) {
  ReliefScene scene{.shape = ReliefShape::kFlat, .sensor = SensorModel{}};
  Rig rig;
  rig.lights = DistantRing(3, 0.5);
  const auto render = [&] { return RenderRelief(scene, rig, {16, 16}).value().stack[1].rgb[2]; };
  const Image<float> first = render();

  EXPECT_EQ(render().pixels, first.pixels);
  scene.seed = 2;
  EXPECT_NE(render().pixels, first.pixels);
}

TEST(ReliefScene, NamesTheFieldOutOfRange) {
  const auto message = [](const ReliefScene& scene) { return scene.Validate().error().message; };
  EXPECT_THAT(message({.max_slope_rad = 1.6}), HasSubstr("max_slope_rad = 1.6; need"));
  EXPECT_THAT(message({.ripple_period_px = 0.0}), HasSubstr("ripple_period_px = 0; need"));
  EXPECT_THAT(message({.albedo_min = -0.1}), HasSubstr("albedo_min = -0.1; need"));
  EXPECT_THAT(message({.albedo_max = 1.1}), HasSubstr("albedo_max = 1.1; need"));
  EXPECT_THAT(message({.sensor = SensorModel{.bits = 17}}), HasSubstr("sensor.bits = 17; need"));
  EXPECT_TRUE(ReliefScene{}.Validate());
}

}  // namespace
}  // namespace sateen::relief_test
