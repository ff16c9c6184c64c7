#include "solver/mosaic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "simulation/random.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "solver/light_doubt.h"
#include "tests/solver/solver_cases.h"

namespace sateen {
namespace {

using testing::DistantRig;
using testing::ReasonAt;
using testing::Render;
using testing::SameBits;

constexpr std::array<uint8_t, 4> kRggb = {0, 1, 1, 2};
constexpr double kBlackDn = 500.0;
constexpr double kWhiteDn = 64000.0;
constexpr double kGainDn = 2.0;
constexpr double kReadDn = 8.0;
constexpr ImageSize kSize = {96, 70};

// Mosaics of a rendered scene as a 16-bit sensor reads them, and what they are made of.
struct Readings {
  std::vector<Image<uint16_t>> frames;
  MosaicStack stack;

  explicit Readings(const RenderedRelief& scene, const Rig& rig) {
    stack.size_px = scene.normal.Size();
    stack.cfa = kRggb;
    float most = 0.0F;
    for (const LightFrame& frame : scene.stack) {
      for (const Image<float>& plane : frame.rgb.planes) {
        most = std::max(most, *std::ranges::max_element(plane.pixels));
      }
    }
    const double per_dn = 1.1 * static_cast<double>(most) / (kWhiteDn - kBlackDn);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      stack.lit.push_back(FrameOf(per_dn));
      Image<uint16_t> readings(stack.size_px);
      for (int y = 0; y < readings.height; ++y) {
        for (int x = 0; x < readings.width; ++x) {
          const size_t c = kRggb[static_cast<size_t>(y % 2 * 2 + x % 2)];
          const auto radiance = static_cast<double>(scene.stack[k].rgb[c].At(x, y));
          readings.At(x, y) = static_cast<uint16_t>(std::lround(kBlackDn + radiance / per_dn));
        }
      }
      frames.push_back(std::move(readings));
    }
  }

  static MosaicFrame FrameOf(double per_dn) {
    MosaicFrame frame{.saturated_dn = static_cast<float>(kWhiteDn),
                      .gain_dn = kGainDn,
                      .read_dn = kReadDn,
                      .name = "frame"};
    frame.per_dn.fill(static_cast<float>(per_dn));
    frame.at_zero.fill(static_cast<float>(-kBlackDn * per_dn));
    return frame;
  }

  void AddNoise(uint64_t seed) {
    uint64_t counter = 0;
    for (Image<uint16_t>& frame : frames) {
      for (uint16_t& reading : frame.pixels) {
        const double signal = static_cast<double>(reading) - kBlackDn;
        const double deviation = std::sqrt(kGainDn * signal + kReadDn * kReadDn);
        reading = static_cast<uint16_t>(
            std::lround(static_cast<double>(reading) + deviation * NormalDeviate(seed, counter++)));
      }
    }
  }

  void ForgetNoise() {
    for (MosaicFrame& frame : stack.lit) {
      frame.gain_dn = 0.0;
      frame.read_dn = 0.0;
    }
  }

  [[nodiscard]] NormalField Solve(const Rig& rig, const MosaicOptions& options = {},
                                  int threads = 0, const std::optional<Mask>& mask = std::nullopt) {
    const MosaicsInMemory rows(frames);
    stack.rows = &rows;
    return SolveMosaic(stack, rig, mask, options, {.threads = threads}).value();
  }
};

MosaicOptions Plain(Backend backend = Backend::kAuto) {
  return {.mode = std::nullopt, .least_squares = {.backend = backend}};
}

MosaicOptions Ladder(LadderMode mode, Backend backend = Backend::kAuto) {
  return {.mode = mode, .least_squares = {.backend = backend}};
}

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

struct ErrorsAndUncertainty {
  double actual_over_predicted = 0.0;  // of the root mean squares
  double standardised = 0.0;           // root mean square of error over uncertainty
};

ErrorsAndUncertainty CompareErrors(const NormalField& field, const RenderedRelief& truth) {
  Image<float> error_deg;
  EXPECT_TRUE(AngularErrorDeg(field, truth.normal, &error_deg));
  double squares = 0.0;
  double predicted = 0.0;
  double standardised = 0.0;
  for (size_t p = 0; p < error_deg.pixels.size(); ++p) {
    const auto e = static_cast<double>(error_deg.pixels[p]);
    const auto u = static_cast<double>(field.uncertainty.pixels[p]);
    squares += e * e;
    predicted += u * u;
    standardised += e * e / (u * u);
  }
  return {.actual_over_predicted = std::sqrt(squares / predicted),
          .standardised = std::sqrt(standardised / static_cast<double>(error_deg.pixels.size()))};
}

// The bound of Cramer and Rao is what `uncertainty` says of a Lambertian site of known noise.
TEST(MosaicTest, ErrorsAreWhatTheBoundAllowsAndTheUncertaintySays) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  const RenderedRelief truth = Render(rig, {256, 192});
  Readings readings(truth, rig);
  readings.AddNoise(11);
  const NormalField field = readings.Solve(rig);
  const ErrorsAndUncertainty errors = CompareErrors(field, truth);
  EXPECT_LT(errors.actual_over_predicted, 1.05);
  EXPECT_NEAR(errors.standardised, 1.0, 0.03);
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
  const MosaicsInMemory rows(readings.frames);
  readings.stack.rows = &rows;
  for (const int band_rows : {1, 7, 64}) {
    NormalField joined;
    joined.Resize(kSize);
    joined.uncertainty = Image<float>(kSize);
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
      return Status();
    };
    MosaicOptions options;
    options.band_rows = band_rows;
    const auto summary = SolveMosaicByBands(readings.stack, rig, mask, options, {}, sink);
    ASSERT_TRUE(summary) << summary.error().message;
    EXPECT_TRUE(SameBits(whole, joined)) << band_rows;
    EXPECT_EQ(whole.uncertainty.pixels, joined.uncertainty.pixels) << band_rows;
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
  }
}

// As above, with nothing said of the noise: readings of a bright scene, whose read noise is little.
TEST(MosaicTest, NoiseThatIsNotKnownIsMeasured) {
  const Rig rig = RingRig({256, 192}, LightModel::kNear);
  const RenderedRelief truth = Render(rig, {256, 192});
  Readings readings(truth, rig);
  readings.AddNoise(11);
  readings.ForgetNoise();
  const NormalField whole = readings.Solve(rig);
  EXPECT_FALSE(whole.summary.noise_known);
  EXPECT_NEAR(whole.summary.noise_scale, std::sqrt(kGainDn), 0.05 * std::sqrt(kGainDn));
  EXPECT_NEAR(CompareErrors(whole, truth).standardised, 1.0, 0.07);
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
TEST(MosaicTest, ShineIsNotTakenForNoise) {
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
TEST(MosaicTest, ADarkCaptureOfUnknownNoiseIsDark) {
  const Rig rig = DistantRig(DistantRing(5, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  for (Image<uint16_t>& frame : readings.frames) {
    std::ranges::fill(frame.pixels, static_cast<uint16_t>(kBlackDn));
  }
  readings.ForgetNoise();
  const NormalField field = readings.Solve(rig);
  EXPECT_EQ(field.summary.dark, static_cast<int64_t>(kSize.PixelCount()));
}

// Readings of few whole numbers, whose neighbours mostly do not differ: 0.05 DN an electron.
TEST(MosaicTest, NoiseBelowRoundingIsMeasured) {
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

TEST(MosaicTest, LightsThatAreUncertainMakeNormalsUncertain) {
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
      ASSERT_GT(unsure.uncertainty.At(x, row), 0.3F);
    }
  }
}

TEST(MosaicTest, ThreeLightsAndNoNeighboursTellNothingOfTheNoise) {
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
}

TEST(MosaicTest, WhatCannotBeSolvedIsRefusedInWords) {
  const Rig rig = DistantRig(DistantRing(5, 40.0 * kRadPerDeg));
  Readings readings(Render(rig, kSize), rig);
  const MosaicsInMemory rows(readings.frames);
  readings.stack.rows = &rows;
  const auto refusal = [&](const MosaicStack& stack, const MosaicOptions& options = {}) {
    const Result<NormalField> field = SolveMosaic(stack, rig, std::nullopt, options);
    return field ? std::string("solved") : field.error().message;
  };
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
}  // namespace sateen
