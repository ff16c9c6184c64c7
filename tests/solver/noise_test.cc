#include "solver/noise.h"

#include <gtest/gtest.h>

#include "tests/solver/ladder_cases.h"

namespace sateen::noise_test {
namespace {

using testing::TwoRings;

TEST(SolveLadder, ChiSquaredQuantiles) {
  // Tables: 95 % of 7 degrees of freedom 14.067, 25 % 4.255, 99.9 % 24.322; 5 % of 93 71.76.
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.95, 7) * 7.0, 14.067, 0.05);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.25, 7) * 7.0, 4.255, 0.05);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.999, 7) * 7.0, 24.322, 0.25);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.05, 93) * 93.0, 71.76, 0.2);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.05, 1), 0.00393, 1e-5);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.999, 1), 10.828, 1e-3);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.05, 2) * 2.0, 0.10259, 1e-5);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.999, 2) * 2.0, 13.816, 1e-3);
  // The cube root is at its worst.
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.05, 3) * 3.0, 0.35185, 0.07 * 0.35185);
  EXPECT_NEAR(ReducedChiSquaredQuantile(0.999, 3) * 3.0, 16.266, 0.02 * 16.266);
}

TEST(NoiseOf, TakesGainAndWhiteBalanceFromTheRig) {
  Rig rig = TwoRings();
  Response response;
  response.black = 600.0;
  response.white = 15600.0;
  response.white_balance = {2.0, 1.0, 1.5};
  response.gain_dn_per_electron = 0.25;
  response.read_noise_dn = 3.0;
  rig.response = response;
  LightStack stack(1);
  stack[0].raw = true;
  stack[0].full_scale = 30.0F;  // the largest, red: 2e-3 per DN, green half of that
  const StackNoise noise = NoiseOf(stack, rig).value();
  EXPECT_DOUBLE_EQ(noise[0].shot[0], 0.25 * 2e-3);
  EXPECT_DOUBLE_EQ(noise[0].shot[1], 0.25 * 1e-3);
  EXPECT_DOUBLE_EQ(noise[0].read[2], 3.0 * 1.5e-3);
  stack[0].merged = true;
  EXPECT_FALSE(NoiseOf(stack, rig));
  stack[0].merged = false;
  stack[0].raw = false;
  EXPECT_FALSE(NoiseOf(stack, rig));
  stack[0].raw = true;
  rig.response->gain_dn_per_electron.reset();
  EXPECT_FALSE(NoiseOf(stack, rig));
}

}  // namespace
}  // namespace sateen::noise_test
