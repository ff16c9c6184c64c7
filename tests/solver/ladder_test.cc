#include "solver/ladder.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tests/solver/ladder_cases.h"

namespace sateen::ladder_test {
namespace {

using testing::DistantRig;
using testing::ErrorOf;
using testing::Forced;
using testing::MustSolve;
using testing::NoiseOfSensor;
using testing::Noisy;
using testing::NoisyScene;
using testing::Render;
using testing::RippleOf;
using testing::SameBits;
using testing::Spoil;
using testing::TwoRings;

// Mean square angle, in degrees, that no unbiased estimate from the RGB samples can be below: the
// inverse Fisher information of n on the sphere and the three albedos, by its definition.
double CramerRaoDegSquared(const Rig& rig, const RenderedRelief& truth, const StackNoise& noise,
                           size_t pixel) {
  const Eigen::Vector3d n(truth.normal[0].pixels[pixel], truth.normal[1].pixels[pixel],
                          truth.normal[2].pixels[pixel]);
  const Eigen::Vector3d across = n.unitOrthogonal();
  const Eigen::Vector3d along = n.cross(across);
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Zero();
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    const Eigen::Vector3d& l = rig.lights[k].direction;
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<size_t>(c);
      const double rho = truth.albedo[channel].pixels[pixel];
      const double e = rig.lights[k].flux_rgb[c];
      const double variance = noise[k].shot[channel] * rho * e * n.dot(l) +
                              noise[k].read[channel] * noise[k].read[channel];
      Eigen::Matrix<double, 5, 1> slope = Eigen::Matrix<double, 5, 1>::Zero();
      slope[0] = rho * e * across.dot(l);
      slope[1] = rho * e * along.dot(l);
      slope[2 + c] = e * n.dot(l);
      information += slope * slope.transpose() / variance;
    }
  }
  return information.inverse().topLeftCorner<2, 2>().trace() * kDegPerRad * kDegPerRad;
}

TEST(SolveLadder, ReachesTheCramerRaoBoundAtFiveExposures) {
  // 16,000 angles: their mean square is within 1.2 % (three sigma: 1 / sqrt(16,000) each).
  for (const double full_scale : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    const Noisy scene = NoisyScene(full_scale, 3);
    LadderOptions options;
    options.noise = scene.noise;
    const NormalField field = MustSolve(scene.rendered.stack, scene.rig, options);
    Image<float> error;
    ASSERT_TRUE(AngularErrorDeg(field, scene.rendered.normal, &error));
    double squares = 0.0;
    double bound = 0.0;
    for (size_t p = 0; p < error.pixels.size(); ++p) {
      squares += std::pow(static_cast<double>(error.pixels[p]), 2.0);
      bound += CramerRaoDegSquared(scene.rig, scene.rendered, scene.noise, p);
    }
    EXPECT_LE(std::sqrt(squares / bound), 1.05) << "full scale " << full_scale;
    EXPECT_GE(std::sqrt(squares / bound), 0.98) << "full scale " << full_scale;
  }
}

TEST(SolveLadder, WeightsDoNotBias) {
  // Weights from the samples themselves would draw albedo and slope down by about one part in the
  // electrons of a sample: 2 % at the 50 electrons here. The mean of 16,000 pixels is good to 0.2
  // %.
  const SensorModel sensor{.full_scale = 1.0, .electrons = 150.0, .read_noise_electrons = 1.0};
  const Rig rig = TwoRings();
  const RenderedRelief rendered =
      RenderRelief(
          {.shape = ReliefShape::kFlat, .albedo_min = 0.5, .albedo_max = 0.5, .sensor = sensor},
          rig, {160, 100})
          .value();
  LadderOptions options = Forced(LadderMode::kLeastSquares);
  options.noise = NoiseOfSensor(sensor, rig.lights.size());
  const NormalField field = MustSolve(rendered.stack, rig, options);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t p = 0; p < field.normal[0].pixels.size(); ++p) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      sum[c] += static_cast<double>(field.normal[static_cast<size_t>(c)].pixels[p]);
    }
  }
  EXPECT_LT(std::atan2(sum.head<2>().norm(), sum.z()) * kDegPerRad, 0.15);
}

TEST(SolveLadder, LambertianScenesLoseNothing) {
  const Noisy scene = NoisyScene(2.0, 7);
  const NormalField plain = SolveLambertian(scene.rendered.stack, scene.rig, std::nullopt).value();
  for (const bool known : {true, false}) {
    LadderOptions options;
    if (known) {
      options.noise = scene.noise;
    }
    const NormalField field = MustSolve(scene.rendered.stack, scene.rig, options);
    EXPECT_LE(ErrorOf(field, scene.rendered).mean, 1.01 * ErrorOf(plain, scene.rendered).mean);
    EXPECT_LT(field.summary.robust.pixels, 16000 / 100);
  }
}

TEST(SolveLadder, OrderOfLightsDoesNotMatter) {
  Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
  Spoil(rendered.stack, 3, 5);
  const NormalField before = MustSolve(rendered.stack, rig);
  std::reverse(rig.lights.begin(), rig.lights.end());
  std::reverse(rendered.stack.begin(), rendered.stack.end());
  const NormalField after = MustSolve(rendered.stack, rig);
  int differ = 0;
  for (size_t p = 0; p < before.model.pixels.size(); ++p) {
    differ += std::abs(before.normal[0].pixels[p] - after.normal[0].pixels[p]) > 1e-4F ? 1 : 0;
  }
  EXPECT_LE(differ, 3);  // ties
}

TEST(SolveLadder, ScaleOfRadianceDoesNotMatter) {
  const Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
  Spoil(rendered.stack, 2, 6);
  const NormalField before = MustSolve(rendered.stack, rig);
  testing::ScaleRadiance(rendered.stack, 1024.0F);  // a power of two: exact
  const NormalField after = MustSolve(rendered.stack, rig);
  EXPECT_EQ(before.normal[0].pixels, after.normal[0].pixels);
  EXPECT_EQ(before.model.pixels, after.model.pixels);
  for (size_t p = 0; p < before.model.pixels.size(); ++p) {
    EXPECT_NEAR(after.uncertainty.pixels[p], before.uncertainty.pixels[p],
                1e-3F * before.uncertainty.pixels[p]);
  }
}

TEST(SolveLadder, AnyNumberOfThreadsGivesTheSameBits) {
  const ImageSize size{640, 60};  // several pieces
  const Rig rig = RingRig(size);
  RenderedRelief rendered = Render(rig, size, 20.0);
  Spoil(rendered.stack, 2, 9);
  const NormalField one = MustSolve(rendered.stack, rig, {}, 1);
  for (const int threads : {2, 7}) {
    const NormalField many = MustSolve(rendered.stack, rig, {}, threads);
    EXPECT_TRUE(SameBits(one, many));
    EXPECT_EQ(one.uncertainty.pixels, many.uncertainty.pixels);
    EXPECT_EQ(one.albedo_uncertainty.pixels, many.albedo_uncertainty.pixels);
    EXPECT_EQ(one.model.pixels, many.model.pixels);
  }
}

TEST(SolveLadder, ThreeFourAndFiveLights) {
  for (const int count : {3, 4, 5}) {
    const Rig rig = DistantRig(DistantRing(count, 40.0 * kRadPerDeg));
    const RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
    for (const LadderMode mode : {LadderMode::kAuto, LadderMode::kConsensus}) {
      const NormalField field = MustSolve(rendered.stack, rig, Forced(mode));
      EXPECT_EQ(field.summary.solved, 1200) << count;
      EXPECT_LT(ErrorOf(field, rendered).max, 1e-2) << count;
    }
    const NormalField field = MustSolve(rendered.stack, rig);
    EXPECT_EQ(field.model.pixels[600],
              static_cast<uint8_t>(count == 3 ? Rung::kUnchecked : Rung::kLeastSquares));
  }
}

TEST(SolveLadder, AFieldThatIsUsedAgainKeepsNothing) {
  const Rig rig = TwoRings();
  const RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, {40, 30});
  Mask mask({40, 30}, 0);
  std::fill_n(mask.pixels.begin(), 600, uint8_t{255});
  for (const Backend backend : {Backend::kAuto, Backend::kJacobiSvd}) {
    LadderOptions options;
    options.least_squares.backend = backend;
    const NormalField fresh = SolveLadder(rendered.stack, rig, mask, options).value();
    NormalField field = MustSolve(rendered.stack, rig, options);
    ASSERT_TRUE(SolveLadderInto(rendered.stack, rig, mask, options, {}, field));
    EXPECT_EQ(field.uncertainty.pixels, fresh.uncertainty.pixels);
    EXPECT_EQ(field.model.pixels, fresh.model.pixels);
    EXPECT_EQ(field.summary.least_squares.mean_uncertainty_deg,
              fresh.summary.least_squares.mean_uncertainty_deg);
  }
}

TEST(SolveLadder, ThreeSamplesAreUncheckedInEveryMode) {
  const Rig rig = DistantRig(DistantRing(3, 40.0 * kRadPerDeg));
  const RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
  const NormalField field = MustSolve(rendered.stack, rig, Forced(LadderMode::kConsensus));
  EXPECT_EQ(field.summary.unchecked, 1200);
  EXPECT_EQ(field.summary.unexplained, 0);
  EXPECT_EQ(field.model.pixels[600], static_cast<uint8_t>(Rung::kUnchecked));
}

TEST(SolveLadder, NamesTheFrameWhoseNoiseIsOutOfRange) {
  const Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {4, 3});
  rendered.stack[2].name = "third.dng";
  for (const SampleNoise& bad :
       {SampleNoise{.shot = {1.0, -1.0, 1.0}}, SampleNoise{.read = {0.0, 0.0, std::nan("")}},
        SampleNoise{.shot = {INFINITY, 1.0, 1.0}}, SampleNoise{.shot = {0.0, 1.0, 1.0}}}) {
    LadderOptions options;
    options.noise = UnknownNoise(10);
    (*options.noise)[2] = bad;
    const Result<NormalField> field = SolveLadder(rendered.stack, rig, std::nullopt, options);
    ASSERT_FALSE(field);
    EXPECT_EQ(field.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(field.error().message.find("third.dng"), std::string::npos);
  }
}

TEST(SolveLadder, NamesTheOptionThatIsOutOfRange) {
  const Rig rig = TwoRings();
  const RenderedRelief rendered = Render(rig, {4, 3});
  for (const double bad : {0.0, 0.5, std::nan("")}) {
    LadderOptions options;
    options.climb.false_alarms = bad;
    const Result<NormalField> field = SolveLadder(rendered.stack, rig, std::nullopt, options);
    ASSERT_FALSE(field);
    EXPECT_NE(field.error().message.find("false_alarms"), std::string::npos);
  }
  LadderOptions options;
  options.noise = StackNoise(3);
  EXPECT_EQ(SolveLadder(rendered.stack, rig, std::nullopt, options).error().code,
            ErrorCode::kBadData);
}

}  // namespace
}  // namespace sateen::ladder_test
