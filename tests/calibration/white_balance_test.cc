#include "calibration/response/white_balance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::white_balance_test {
namespace {

// Signals of one patch in one frame, each known to `relative_sd`.
void AddSamples(size_t light, size_t frame, size_t patch, const Eigen::Vector3d& signal_dn,
                const Eigen::Vector3d& relative_sd, std::vector<PatchSample>& samples) {
  for (size_t c = 0; c < 3; ++c) {
    const auto i = static_cast<Eigen::Index>(c);
    samples.push_back({.frame = frame,
                       .light = light,
                       .patch = patch,
                       .colour = c,
                       .signal_dn = signal_dn[i],
                       .sd_dn = relative_sd[i] * signal_dn[i]});
  }
}

const std::vector<Eigen::Vector3d> kGreys(2, Eigen::Vector3d(0.5, 0.5, 0.5));
const Eigen::Vector3d kNoise(0.003, 0.004, 0.001);

TEST(BalanceLights, OnePatchGivesTheRatioAndTheNoiseOfBothColours) {
  std::vector<PatchSample> samples;
  AddSamples(1, 0, 0, {500.0, 1000.0, 800.0}, kNoise, samples);
  const auto lights = BalanceLights(samples, kGreys, 3);
  ASSERT_EQ(lights.size(), 3U);
  EXPECT_FALSE(lights[0]);
  ASSERT_TRUE(lights[1]);
  EXPECT_NEAR(lights[1]->white_balance[0], 2.0, 1e-12);
  EXPECT_EQ(lights[1]->white_balance[1], 1.0);
  EXPECT_NEAR(lights[1]->white_balance[2], 1.25, 1e-12);
  EXPECT_NEAR(lights[1]->sd[0], 2.0 * 0.005, 1e-12);
  EXPECT_NEAR(lights[1]->sd[2], 1.25 * std::hypot(0.004, 0.001), 1e-12);
  EXPECT_EQ(lights[1]->patches, 1U);
}

TEST(BalanceLights, ReflectancesAreDividedOut) {
  std::vector<PatchSample> samples;
  AddSamples(0, 0, 0, {500.0, 1000.0, 800.0}, kNoise, samples);
  const auto lights = BalanceLights(samples, {Eigen::Vector3d(0.4, 0.5, 0.6)}, 1);
  EXPECT_NEAR(lights[0]->white_balance[0], 2.0 * 0.4 / 0.5, 1e-12);
  EXPECT_NEAR(lights[0]->white_balance[2], 1.25 * 0.6 / 0.5, 1e-12);
}

// Frames of one patch are averaged by their noise; what patches differ by beyond it is theirs.
TEST(BalanceLights, TheScatterOfPatchesCountsWhereItIsLarger) {
  std::vector<PatchSample> samples;
  const Eigen::Vector3d noise(0.001, 0.001, 0.001);
  AddSamples(0, 0, 0, {1010.0, 1000.0, 1000.0}, noise, samples);
  AddSamples(0, 0, 1, {990.0, 1000.0, 1000.0}, noise, samples);
  const LightBalance balance = *BalanceLights(samples, kGreys, 1)[0];
  const double low = -std::log(1.01);
  const double high = -std::log(0.99);
  EXPECT_NEAR(balance.white_balance[0], std::exp(0.5 * (low + high)), 1e-12);
  EXPECT_NEAR(balance.sd[0], 0.5 * (high - low), 1e-5);  // the error of a mean of two
  EXPECT_NEAR(balance.sd[2], 0.001, 1e-5);               // noise: sqrt 2 / sqrt 2
  EXPECT_EQ(balance.patches, 2U);
}

// The mean of three patches is known to their scatter over sqrt(3 (3 - 1)).
TEST(BalanceLights, TheMeanOfThreePatchesIsKnownBetterThanOne) {
  std::vector<PatchSample> samples;
  const Eigen::Vector3d noise(1e-4, 1e-4, 1e-4);
  const double step = 0.02;
  for (size_t patch = 0; patch < 3; ++patch) {
    const double factor = std::exp(step * (static_cast<double>(patch) - 1.0));
    AddSamples(0, 0, patch, {1000.0 / factor, 1000.0, 1000.0}, noise, samples);
  }
  const LightBalance balance =
      *BalanceLights(samples, std::vector<Eigen::Vector3d>(3, kGreys[0]), 1)[0];
  EXPECT_NEAR(balance.white_balance[0], 1.0, 1e-9);
  EXPECT_NEAR(balance.sd[0], std::sqrt(2.0 * step * step / 6.0), 1e-5);
}

TEST(BalanceLights, NoisierFramesCountLess) {
  std::vector<PatchSample> samples;
  const Eigen::Vector3d good(0.001, 0.0, 0.001);
  AddSamples(0, 0, 0, {1000.0, 1000.0, 1000.0}, good, samples);
  AddSamples(0, 1, 0, {900.0, 1000.0, 1000.0}, 3.0 * good, samples);  // a ninth of the weight
  const LightBalance balance = *BalanceLights(samples, kGreys, 1)[0];
  EXPECT_NEAR(balance.white_balance[0], std::exp(-0.1 * std::log(0.9)), 1e-9);
}

TEST(BalanceLights, APatchWithoutAColourIsNotUsed) {
  std::vector<PatchSample> samples;
  AddSamples(0, 0, 0, {500.0, 1000.0, 800.0}, kNoise, samples);
  samples.pop_back();  // blue was saturated
  EXPECT_FALSE(BalanceLights(samples, kGreys, 1)[0]);
}

}  // namespace
}  // namespace sateen::white_balance_test
