#include <gtest/gtest.h>

#include "solver/light_doubt.h"
#include "tests/solver/mosaic_cases.h"

namespace sateen::mosaic_noise_test {
namespace {

using testing::CompareErrors;
using testing::DistantRig;
using testing::kBlackDn;
using testing::kGainDn;
using testing::kSize;
using testing::Ladder;
using testing::Readings;
using testing::Render;

// Nothing is said of the noise: readings of a bright scene, whose read noise is little.
TEST(MosaicNoise, NoiseThatIsNotKnownIsMeasured) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  const RenderedRelief truth = Render(rig, {256, 192});
  Readings readings(truth, rig);
  readings.AddNoise(11);
  readings.ForgetNoise();
  const NormalField whole = readings.Solve(rig);
  EXPECT_FALSE(whole.summary.noise_known);
  EXPECT_NEAR(whole.summary.noise_scale, std::sqrt(kGainDn), 0.05 * std::sqrt(kGainDn));
  EXPECT_NEAR(CompareErrors(whole, truth, readings.stack.cfa).standardised, 1.0, 0.07);
  EXPECT_LT(whole.summary.robust.pixels, whole.summary.solved / 200);

  // A mask between the rows that would be looked at without one.
  Mask mask(whole.reason.Size());
  for (int x = 20; x < 200; ++x) {
    mask.At(x, 100) = 255;
  }
  const NormalField masked = readings.Solve(rig, {}, 0, mask);
  EXPECT_NEAR(masked.summary.noise_scale, std::sqrt(kGainDn), 0.3 * std::sqrt(kGainDn));
}

// A scene that shines everywhere misfits everywhere; what neighbours differ by is not fooled.
TEST(MosaicNoise, ShineIsNotTakenForNoise) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  RenderedRelief truth = Render(rig, {256, 192});
  for (size_t k = 0; k < truth.stack.size(); k += 3) {
    for (Image<float>& plane : truth.stack[k].rgb.planes) {
      std::ranges::transform(plane.pixels, plane.pixels.begin(), [](float i) { return 1.5F * i; });
    }
  }
  Readings readings(truth, rig);
  readings.AddNoise(11);
  readings.ForgetNoise();
  const NormalField field = readings.Solve(rig);
  EXPECT_LT(field.summary.noise_scale, 2.0 * std::sqrt(kGainDn));
}

// Reasons are told where there is nothing to measure noise on.
TEST(MosaicNoise, ADarkCaptureOfUnknownNoiseIsDark) {
  const Rig rig = DistantRig(DistantRing(5, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  for (Image<uint16_t>& frame : readings.frames) {
    std::ranges::fill(frame.pixels, static_cast<uint16_t>(kBlackDn));
  }
  readings.ForgetNoise();
  const NormalField field = readings.Solve(rig);
  EXPECT_EQ(field.summary.dark, static_cast<int64_t>(kSize.PixelCount()));
}

// Readings of few whole numbers, whose neighbours mostly do not differ: 0.02 DN per electron.
TEST(MosaicNoise, NoiseBelowRoundingIsMeasured) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  Readings readings(Render(rig, {256, 192}), rig);
  uint64_t counter = 0;
  for (Image<uint16_t>& frame : readings.frames) {
    for (uint16_t& reading : frame.pixels) {
      const double signal = (static_cast<double>(reading) - kBlackDn) / 4000.0;  // 0 to 14 DN
      reading = static_cast<uint16_t>(
          std::lround(20.0 + signal + std::sqrt(0.02 * signal) * NormalDeviate(5, counter++)));
    }
  }
  for (MosaicFrame& frame : readings.stack.lit) {
    frame.per_dn.fill(frame.per_dn[0] * 4000.0F);
    frame.at_zero.fill(-20.0F * frame.per_dn[0]);
    frame.saturated_dn = 40.0F;
  }
  readings.ForgetNoise();
  const NormalField field = readings.Solve(rig);
  EXPECT_GT(field.summary.noise_scale, std::sqrt(0.01));
  EXPECT_LT(field.summary.noise_scale, std::sqrt(0.06));
}

TEST(MosaicNoise, LightsThatAreUncertainMakeNormalsUncertain) {
  Rig rig = RingRig({96, 150}, LightModel::kNear);
  Readings readings(Render(rig, {96, 150}), rig);
  const NormalField sure = readings.Solve(rig, Ladder(LadderMode::kLeastSquares));
  for (Light& light : rig.lights) {
    light.irradiance_sd = 0.02;
  }
  MosaicOptions by_bands = Ladder(LadderMode::kLeastSquares);
  by_bands.band_rows = 40;
  const NormalField unsure = readings.Solve(rig, by_bands);
  NormalField expected = sure;
  const LightDoubt doubt = LightDoubt::Make(rig, {96, 150}).value();
  for (const int row : {3, 70, 149}) {
    doubt.AddToRow(row, sure.reason.Index(0, row), expected);
    for (int x = 0; x < 96; ++x) {
      ASSERT_FLOAT_EQ(unsure.uncertainty.At(x, row), expected.uncertainty.At(x, row));
      ASSERT_FLOAT_EQ(unsure.albedo_uncertainty.At(x, row), expected.albedo_uncertainty.At(x, row));
      ASSERT_GT(unsure.uncertainty.At(x, row), 0.3F);
    }
  }
}

TEST(MosaicNoise, ThreeLightsAndNoNeighboursTellNothingOfTheNoise) {
  const Rig rig = DistantRig(DistantRing(3, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  readings.ForgetNoise();
  Mask mask(kSize);
  for (int y = 0; y < kSize.height; ++y) {
    mask.At(40, y) = 255;
  }
  const NormalField field = readings.Solve(rig, {}, 0, mask);
  EXPECT_EQ(field.summary.solved, kSize.height);
  EXPECT_EQ(field.summary.noise_scale, 0.0);
  EXPECT_EQ(field.uncertainty.At(40, 9), 180.0F);
  EXPECT_EQ(field.albedo_uncertainty.At(40, 9), 1.0F);
}

}  // namespace
}  // namespace sateen::mosaic_noise_test
