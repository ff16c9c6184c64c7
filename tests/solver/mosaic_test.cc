#include "solver/mosaic/mosaic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "tests/solver/mosaic_cases.h"

namespace sateen::mosaic_test {
namespace {

using testing::CompareErrors;
using testing::DistantRig;
using testing::ErrorsAndUncertainty;
using testing::kBlackDn;
using testing::kSize;
using testing::Ladder;
using testing::Plain;
using testing::Readings;
using testing::ReasonAt;
using testing::Render;
using testing::SameBits;

std::vector<Rig> AllRigs() {
  return {DistantRig(DistantRing(10, 40.0 * kRadPerDeg)), RingRig(kSize, LightModel::kNear),
          RingRig(kSize, LightModel::kLed), RingRig(kSize, LightModel::kLedField)};
}

double AngleDeg(const NormalField& a, const NormalField& b, size_t p) {
  Eigen::Vector3d n;
  Eigen::Vector3d m;
  for (size_t c = 0; c < 3; ++c) {
    n[static_cast<Eigen::Index>(c)] = static_cast<double>(a.normal[c].pixels[p]);
    m[static_cast<Eigen::Index>(c)] = static_cast<double>(b.normal[c].pixels[p]);
  }
  return std::atan2(n.cross(m).norm(), n.dot(m)) * kDegPerRad;
}

// Some readings saturated, some black.
void SpoilReadings(Readings& readings, uint64_t seed) {
  for (size_t k = 0; k < readings.frames.size(); ++k) {
    for (size_t p = 0; p < readings.frames[k].pixels.size(); ++p) {
      const double draw = UniformDeviate(seed + k, p);
      uint16_t& reading = readings.frames[k].pixels[p];
      reading = draw < 0.1 ? uint16_t{65535} : draw < 0.2 ? uint16_t{500} : reading;
    }
  }
}

void ExpectNear(const NormalField& fast, const NormalField& reference) {
  ASSERT_EQ(fast.reason.pixels, reference.reason.pixels);
  ASSERT_EQ(fast.samples.pixels, reference.samples.pixels);
  for (size_t p = 0; p < fast.reason.pixels.size(); ++p) {
    if (!IsSolved(fast, p)) {
      continue;
    }
    ASSERT_LT(AngleDeg(fast, reference, p), 1e-3) << p;
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_NEAR(fast.albedo[c].pixels[p], reference.albedo[c].pixels[p],
                  2e-5F * reference.albedo[c].pixels[p])
          << p;
    }
  }
}

TEST(MosaicTest, KernelAgreesWithJacobiSvdForEveryKindOfLight) {
  for (const Rig& rig : AllRigs()) {
    Readings readings(Render(rig, kSize), rig);
    readings.AddNoise(3);
    SpoilReadings(readings, 5);
    ExpectNear(readings.Solve(rig, Plain()), readings.Solve(rig, Plain(Backend::kJacobiSvd)));
  }
}

TEST(MosaicTest, WeightsAgreeWithJacobiSvd) {
  for (const Rig& rig : AllRigs()) {
    Readings readings(Render(rig, kSize), rig);
    readings.AddNoise(3);
    SpoilReadings(readings, 5);
    const NormalField fast = readings.Solve(rig, Ladder(LadderMode::kLeastSquares));
    const NormalField reference =
        readings.Solve(rig, Ladder(LadderMode::kLeastSquares, Backend::kJacobiSvd));
    ExpectNear(fast, reference);
    for (size_t p = 0; p < fast.reason.pixels.size(); ++p) {
      ASSERT_NEAR(fast.uncertainty.pixels[p], reference.uncertainty.pixels[p],
                  1e-3F * reference.uncertainty.pixels[p] + 1e-6F);
      ASSERT_NEAR(fast.albedo_uncertainty.pixels[p], reference.albedo_uncertainty.pixels[p],
                  1e-3F * reference.albedo_uncertainty.pixels[p] + 1e-8F);
    }
    EXPECT_EQ(fast.model.pixels, reference.model.pixels);
  }
}

TEST(MosaicTest, FindsTruthOfExactReadings) {
  for (const Rig& rig : AllRigs()) {
    const RenderedRelief truth = Render(rig, kSize);
    Readings readings(truth, rig);
    for (const MosaicOptions& options : {Plain(), MosaicOptions{}}) {
      const NormalField field = readings.Solve(rig, options);
      const ErrorStatistics error = AngularErrorDeg(field, truth.normal).value();
      EXPECT_EQ(error.count, static_cast<int64_t>(kSize.PixelCount()));
      EXPECT_LT(error.mean, 0.01);  // readings are rounded to 1 of 40,000
      EXPECT_LT(error.max, 0.1);
      const ErrorStatistics albedo = RelativeAlbedoError(field, truth.albedo).value();
      EXPECT_LT(albedo.mean, 3e-3);  // interpolated where it varies
    }
  }
}

// Each channel has its own albedo, its own flux; a site taken for another colour would show.
TEST(MosaicTest, EverySiteIsSolvedInItsOwnColour) {
  Rig rig = DistantRig(DistantRing(8, 40.0 * kRadPerDeg));
  for (Light& light : rig.lights) {
    light.flux_rgb = {0.5, 1.0, 2.0};
  }
  RenderedRelief truth =
      RenderRelief({.max_slope_rad = 0.4, .albedo_min = 0.5, .albedo_max = 0.5}, rig, kSize)
          .value();
  for (LightFrame& frame : truth.stack) {
    for (size_t c = 0; c < 3; ++c) {
      for (float& value : frame.rgb[c].pixels) {
        value *= std::array{1.6F, 0.8F, 0.2F}[c];
      }
    }
  }
  const NormalField field = Readings(truth, rig).Solve(rig);
  for (size_t p = 0; p < kSize.PixelCount(); ++p) {
    ASSERT_NEAR(field.albedo[0].pixels[p], 0.8F, 0.002F) << p;
    ASSERT_NEAR(field.albedo[1].pixels[p], 0.4F, 0.001F) << p;
    ASSERT_NEAR(field.albedo[2].pixels[p], 0.1F, 0.001F) << p;
  }
}

// The bound of Cramer and Rao is what `uncertainty` says of a Lambertian site of known noise.
TEST(MosaicTest, ErrorsAreWhatTheBoundAllowsAndTheUncertaintySays) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  const RenderedRelief truth = Render(rig, {256, 192});
  Readings readings(truth, rig);
  readings.AddNoise(11);
  const NormalField field = readings.Solve(rig);
  const ErrorsAndUncertainty errors = CompareErrors(field, truth, readings.stack.cfa);
  EXPECT_LT(errors.actual_over_predicted, 1.05);
  EXPECT_NEAR(errors.standardised, 1.0, 0.03);
  EXPECT_NEAR(errors.standardised_albedo, 1.0, 0.03);
  EXPECT_LT(field.summary.robust.pixels, field.summary.solved * 3 / 1000);
}

TEST(MosaicTest, ReadingsOffTheModelAreOutvoted) {
  Lights lights = DistantRing(5, 25.0 * kRadPerDeg);
  for (Light light : DistantRing(5, 50.0 * kRadPerDeg)) {
    light.direction = Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitZ()) * light.direction;
    light.channel += 5;
    light.name += "-outer";
    lights.push_back(light);
  }
  const Rig rig = DistantRig(std::move(lights));
  const RenderedRelief truth = Render(rig, kSize);
  Readings readings(truth, rig);
  readings.AddNoise(7);
  for (size_t p = 0; p < kSize.PixelCount(); ++p) {  // highlights under two lights
    for (size_t j = 0; j < 2; ++j) {
      uint16_t& reading = readings.frames[(p + 4 * j) % 10].pixels[p];
      reading = static_cast<uint16_t>(std::min(60000.0, 500.0 + 2.5 * (reading - 500.0)));
    }
  }
  const NormalField plain = readings.Solve(rig, Ladder(LadderMode::kLeastSquares));
  const NormalField robust = readings.Solve(rig);
  EXPECT_GT(AngularErrorDeg(plain, truth.normal)->mean, 5.0);
  EXPECT_LT(AngularErrorDeg(robust, truth.normal)->mean, 0.5);
  EXPECT_GT(robust.summary.robust.pixels, static_cast<int64_t>(0.95 * 96 * 70));
  EXPECT_EQ(robust.model.pixels[500], static_cast<uint8_t>(Rung::kConsensus));
}

TEST(MosaicTest, DarkFramesAreSubtracted) {
  const Rig rig = RingRig(kSize, LightModel::kLed);
  const RenderedRelief truth = Render(rig, kSize);
  Readings readings(truth, rig);
  Image<uint16_t> dark(kSize);
  for (size_t p = 0; p < dark.pixels.size(); ++p) {
    const auto ambient = static_cast<uint16_t>(100 + p % 7 * 40);
    dark.pixels[p] = static_cast<uint16_t>(kBlackDn + ambient);
    for (Image<uint16_t>& frame : readings.frames) {
      frame.pixels[p] = static_cast<uint16_t>(frame.pixels[p] + ambient);
    }
  }
  readings.frames.insert(readings.frames.end(), 2, dark);
  readings.stack.dark.assign(2, readings.stack.lit[0]);
  readings.stack.dark_weights = {0.25F, 0.75F};
  const NormalField field = readings.Solve(rig);
  EXPECT_LT(AngularErrorDeg(field, truth.normal)->max, 0.1);
}

TEST(MosaicTest, BandsAndThreadsGiveTheSameBits) {
  const Rig rig = RingRig(kSize, LightModel::kLedField);
  Readings readings(Render(rig, kSize), rig);
  readings.AddNoise(13);
  SpoilReadings(readings, 17);
  Mask mask(kSize, 1);
  for (int y = 20; y < 40; ++y) {
    std::fill_n(mask.pixels.begin() + static_cast<std::ptrdiff_t>(mask.Index(30, y)), 25,
                uint8_t{0});
  }
  const NormalField whole = readings.Solve(rig, {}, 1, mask);
  EXPECT_TRUE(SameBits(whole, readings.Solve(rig, {}, 3, mask)));
  EXPECT_EQ(ReasonAt(whole, mask.Index(31, 21)), Reason::kOutsideMask);
  readings.stack.rows = std::make_shared<MosaicsInMemory>(readings.frames);
  for (const int band_rows : {1, 7, 64}) {
    NormalField joined;
    joined.Resize(kSize);
    joined.uncertainty = Image<float>(kSize);
    joined.albedo_uncertainty = Image<float>(kSize);
    int expected_row = 0;
    const auto sink = [&](int first_row, const NormalField& band) {
      EXPECT_EQ(first_row, expected_row);
      expected_row += band.reason.height;
      const auto put = [&](const auto& from, auto& to) {
        std::ranges::copy(from.pixels,
                          to.pixels.begin() + static_cast<std::ptrdiff_t>(to.Index(0, first_row)));
      };
      for (size_t c = 0; c < 3; ++c) {
        put(band.normal[c], joined.normal[c]);
        put(band.albedo[c], joined.albedo[c]);
      }
      put(band.residual, joined.residual);
      put(band.samples, joined.samples);
      put(band.reason, joined.reason);
      put(band.uncertainty, joined.uncertainty);
      put(band.albedo_uncertainty, joined.albedo_uncertainty);
      return Status();
    };
    MosaicOptions options;
    options.band_rows = band_rows;
    const auto summary = SolveMosaicByBands(readings.stack, rig, mask, options, {}, sink);
    ASSERT_TRUE(summary) << summary.error().message;
    EXPECT_TRUE(SameBits(whole, joined)) << band_rows;
    EXPECT_EQ(whole.uncertainty.pixels, joined.uncertainty.pixels) << band_rows;
    EXPECT_EQ(whole.albedo_uncertainty.pixels, joined.albedo_uncertainty.pixels) << band_rows;
    EXPECT_EQ(summary->solved, whole.summary.solved);
  }
}

TEST(MosaicTest, UnsolvableSitesHaveTheirReason) {
  const Rig rig = DistantRig(DistantRing(5, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  for (Image<uint16_t>& frame : readings.frames) {
    frame.pixels[10] = 500;  // black
  }
  for (size_t k = 0; k < 3; ++k) {
    readings.frames[k].pixels[20] = 65535;
    readings.frames[k].pixels[30] = 501;
  }
  const NormalField field = readings.Solve(rig);
  EXPECT_EQ(ReasonAt(field, 10), Reason::kDark);
  EXPECT_EQ(ReasonAt(field, 20), Reason::kSaturated);
  EXPECT_EQ(ReasonAt(field, 30), Reason::kTooFewSamples);
  EXPECT_EQ(ReasonAt(field, 31), Reason::kSolved);
  for (const size_t p : {10, 20, 30}) {
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(field.normal[c].pixels[p], 0.0F);
      EXPECT_EQ(field.albedo[c].pixels[p], 0.0F);
    }
    EXPECT_EQ(field.uncertainty.pixels[p], 0.0F);
    EXPECT_EQ(field.albedo_uncertainty.pixels[p], 0.0F);
  }
}

TEST(MosaicTest, WhatCannotBeSolvedIsRefusedInWords) {
  const Rig rig = DistantRig(DistantRing(5, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  readings.stack.rows = std::make_shared<MosaicsInMemory>(readings.frames);
  const auto refusal = [&](const MosaicStack& stack, const MosaicOptions& options = {}) {
    const Result<NormalField> field = SolveMosaic(stack, rig, std::nullopt, options);
    return field ? std::string("solved") : field.error().message;
  };
  MosaicStack empty = readings.stack;
  empty.rows = nullptr;
  EXPECT_THAT(refusal(empty), ::testing::HasSubstr("no readings"));
  MosaicStack fewer = readings.stack;
  fewer.lit.pop_back();
  EXPECT_THAT(refusal(fewer), ::testing::HasSubstr("4 frames but 5 lights"));
  MosaicStack narrow = readings.stack;
  narrow.size_px.width = 32;
  EXPECT_THAT(refusal(narrow), ::testing::HasSubstr("at least 64x2"));
  MosaicOptions no_row;
  no_row.band_rows = 0;
  EXPECT_THAT(refusal(readings.stack, no_row), ::testing::HasSubstr("band_rows"));
}

}  // namespace
}  // namespace sateen::mosaic_test
