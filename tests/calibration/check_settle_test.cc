#include "calibration/check/check_settle.h"

#include <gtest/gtest.h>

#include <cmath>

#include "simulation/random.h"
#include "tests/calibration/synthetic_readings.h"

namespace sateen::check_settle_test {
namespace {

using sateen::testing::CalibratedRig;
using sateen::testing::ReadingsOf;

constexpr double kAlbedo = 0.99;
constexpr int kColumns = 54;
constexpr int kRows = 36;

// Mean over the lights of the variance that the weights stand for.
double MeanVariance(const Rig& rig, const std::vector<SheetReadings>& sheets) {
  const CheckModel model(rig, sheets, kAlbedo);
  const SampleWeights weights =
      SettledWeights(model, std::vector<bool>(rig.lights.size(), true), {});
  double sum = 0.0;
  for (const SheetWeights& light : weights) {
    sum += 1.0 / *std::ranges::max_element(light[0]);
  }
  return sum / static_cast<double>(weights.size());
}

TEST(SettleLight, WeighsByTheNoiseThatIsThere) {
  const Rig rig = CalibratedRig();
  std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 1, 1, {kColumns, kRows});
  EXPECT_NEAR(MeanVariance(rig, sheets), 1.0, 0.05);
  for (std::vector<SheetSample>& samples : sheets[0].samples) {
    for (SheetSample& sample : samples) {
      sample.sd_rgb *= 0.5;
    }
  }
  EXPECT_NEAR(MeanVariance(rig, sheets), 4.0, 4.0 * 0.05);
}

// Squares of 6 x 6 blocks that are off together by half a standard deviation: variances of 1.25 of
// a block and of (1 / 36 + 1 / 4) of a square's mean.
TEST(SettleLight, WhatHangsTogetherCountsLess) {
  const Rig rig = CalibratedRig();
  std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 1, 2, {kColumns, kRows});
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    for (size_t j = 0; j < sheets[0].samples[k].size(); ++j) {
      const int block = sheets[0].blocks[k][j];
      const int square = block / kColumns / 6 * kColumns + block % kColumns / 6;
      sheets[0].samples[k][j].radiance_rgb += 0.5 *
                                              NormalDeviate(77 + k, static_cast<uint64_t>(square)) *
                                              sheets[0].samples[k][j].sd_rgb;
    }
  }
  EXPECT_NEAR(MeanVariance(rig, sheets), 10.0, 1.5);
}

TEST(SettleLight, DustHasNoWeightAndAMoveIsNone) {
  const Rig rig = CalibratedRig();
  Rig actual = rig;
  actual.lights[3].position_mm += Eigen::Vector3d(3.0, 2.0, -4.0);
  std::vector<SheetReadings> sheets = ReadingsOf(rig, actual, 3, 3);
  sheets[0].samples[3][20].radiance_rgb *= 0.9;
  const CheckModel model(rig, sheets, kAlbedo);

  const SettledLight settled = SettleLight(model, 3);

  EXPECT_LT((settled.change.moved_mm - Eigen::Vector3d(3.0, 2.0, -4.0)).norm(), 0.2);
  EXPECT_EQ(settled.weights[0][20], 0.0);
  EXPECT_EQ(std::ranges::count(settled.weights[0], 0.0), 1);
  EXPECT_GT(settled.weights[0][0], 0.4);  // the move is no noise
}

// Readings of which noise is all but a millionth say nothing: the priors stay.
TEST(SettleLight, WithoutDataThePriorIsTheAnswer) {
  const Rig rig = CalibratedRig(LightModel::kLed);
  std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 1, 4);
  for (size_t j = 0; j < sheets[0].samples[0].size(); ++j) {
    SheetSample& sample = sheets[0].samples[0][j];
    sample.sd_rgb.setConstant(1e6);
    sample.radiance_rgb.setConstant(1e6 * NormalDeviate(5, j));
  }
  const CheckModel model(rig, sheets, kAlbedo);

  const LightChange change = SettleLight(model, 0).change;

  EXPECT_LT(change.log_flux.norm(), 3e-4 * 3.0);
  EXPECT_LT(change.moved_mm.norm(), 1e-5 * 100.0);
  EXPECT_LT(change.turned_rad.norm(), 1e-5);
}

TEST(SettledWeights, LightsWithoutAPartHaveNone) {
  const Rig rig = CalibratedRig();
  const std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 1, 6, {6, 6});
  std::vector<bool> used(rig.lights.size(), true);
  used[2] = false;
  const SampleWeights weights = SettledWeights(CheckModel(rig, sheets, kAlbedo), used, {});
  EXPECT_TRUE(weights[2].empty());
  EXPECT_EQ(weights[3][0].size(), 36U);
}

}  // namespace
}  // namespace sateen::check_settle_test
