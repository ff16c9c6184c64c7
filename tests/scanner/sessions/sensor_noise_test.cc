#include "scanner/sessions/frames/sensor_noise.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

#include "imaging/dng.h"
#include "tests/testing/files.h"

namespace sateen::sensor_noise_test {
namespace {

using ::testing::HasSubstr;

constexpr ImageSize kSize{512, 256};
constexpr double kBlack = 200.0;
constexpr double kGain = 0.3;
constexpr double kRead = 4.0;

// A light's frame of a striped cloth, its repeat, and two dark frames, with the noise of a sensor.
class SensorNoiseTest : public ::testing::Test {
 protected:
  struct Exposure {
    double brightness = 0.0;  // brightness of the cloth; 0: dark
    double right_px = 0.0;    // shift of a part: from this share of the width on
    double moved_from = 0.9;
    bool is_noisy = true;
  };

  FrameFile Write(const std::string& name, const Exposure& exposure) {
    Image<uint16_t> mosaic(kSize);
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        const double at = x + (x >= exposure.moved_from * kSize.width ? exposure.right_px : 0.0);
        // Up to 3,400 DN over a slope from left to right; down to 0.8 of it in stripes of 7 sites.
        const double signal = exposure.brightness * (200.0 + 3200.0 * x / kSize.width) *
                              (0.9 + 0.1 * std::sin(2.0 * std::numbers::pi * at / 7.0));
        std::normal_distribution<double> noise(0.0, std::sqrt(kGain * signal + kRead * kRead));
        const double dn = kBlack + signal + (exposure.is_noisy ? noise(random_) : 0.0);
        mosaic.At(x, y) = static_cast<uint16_t>(std::lround(std::max(dn, 0.0)));
      }
    }
    const std::filesystem::path path = folder_.Path() / name;
    EXPECT_TRUE(WriteDng(path, mosaic, {.black = kBlack, .white = 16000.0}));
    return {.path = path};
  }
  ReadPlan PlanOf(const Exposure& first, const Exposure& again) {
    ReadPlan plan;
    plan.repeated = {Write("first.dng", first), Write("again.dng", again)};
    plan.dark = {Write("dark-first.dng", {}), Write("dark-last.dng", {})};
    return plan;
  }

  testing::TempFolder folder_;
  std::mt19937 random_{7};
};

TEST_F(SensorNoiseTest, IsThatOfTheSensorThoughTheLightDrifted) {
  // Drift and the stripes alone would double the variance of the brightest tiles.
  const ReadPlan plan = PlanOf({.brightness = 1.0}, {.brightness = 0.96});
  const std::optional<SensorNoise> noise = FindSensorNoise(plan).value();
  ASSERT_TRUE(noise);
  EXPECT_NEAR(noise->gain_dn, kGain, 0.03 * kGain);
  EXPECT_NEAR(noise->read_dn, kRead, 0.03 * kRead);
  EXPECT_THAT(noise->source, HasSubstr("again.dng"));
  EXPECT_EQ(noise->sha256_of_input.count(noise->source), 1U);
}

TEST_F(SensorNoiseTest, ATenthOfThePictureThatMovedDoesNoHarm) {
  const ReadPlan plan = PlanOf({.brightness = 1.0}, {.brightness = 1.0, .right_px = 2.0});
  const std::optional<SensorNoise> noise = FindSensorNoise(plan).value();
  ASSERT_TRUE(noise);
  EXPECT_NEAR(noise->gain_dn, kGain, 0.03 * kGain);  // it is all of the brightest groups
}

// Half a pixel: what would be taken for noise is three times what there is.
TEST_F(SensorNoiseTest, APictureThatMovedAsAWholeTellsNothing) {
  const ReadPlan plan =
      PlanOf({.brightness = 1.0}, {.brightness = 1.0, .right_px = 0.5, .moved_from = 0.0});
  EXPECT_FALSE(FindSensorNoise(plan).value());
}

TEST_F(SensorNoiseTest, ADarkPairOfDifferentTimesIsNoPair) {
  ReadPlan plan = PlanOf({.brightness = 1.0}, {.brightness = 1.0});
  plan.dark.back().path = Write("other.dng", {.brightness = 0.5}).path;
  plan.dark.back().exposure = 2.0;
  const std::optional<SensorNoise> noise = FindSensorNoise(plan).value();
  ASSERT_TRUE(noise);
  EXPECT_NEAR(noise->gain_dn, kGain, 0.03 * kGain);
}

TEST_F(SensorNoiseTest, TheRigsWordComesFirst) {
  ReadPlan plan = PlanOf({.brightness = 1.0}, {.brightness = 1.0});
  plan.rig.response.emplace();
  plan.rig.response->gain_dn_per_electron = 0.7;
  plan.rig.response->read_noise_dn = 1.5;
  const std::optional<SensorNoise> noise = FindSensorNoise(plan).value();
  ASSERT_TRUE(noise);
  EXPECT_EQ(noise->gain_dn, 0.7);
  EXPECT_EQ(noise->read_dn, 1.5);
  EXPECT_EQ(noise->source, "the rig");
}

TEST_F(SensorNoiseTest, WhatTellsNothingIsNotBelieved) {
  EXPECT_FALSE(FindSensorNoise(ReadPlan()).value());
  const Exposure still{.brightness = 1.0, .is_noisy = false};
  ReadPlan plan = PlanOf(still, still);
  plan.dark = {Write("d0.dng", {.is_noisy = false}), Write("d1.dng", {.is_noisy = false})};
  EXPECT_FALSE(FindSensorNoise(plan).value());
}

TEST_F(SensorNoiseTest, ARepeatThatChangedSinceItsCaptureIsRefused) {
  ReadPlan plan = PlanOf({.brightness = 1.0}, {.brightness = 1.0});
  plan.repeated->again.sha256 = std::string(64, '0');
  const Result<std::optional<SensorNoise>> noise = FindSensorNoise(plan);
  ASSERT_FALSE(noise);
  EXPECT_EQ(noise.error().code, ErrorCode::kBadData);
}

}  // namespace
}  // namespace sateen::sensor_noise_test
