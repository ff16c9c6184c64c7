#include "calibration/response/response_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/calibration/synthetic_chart.h"

namespace sateen::response_fit_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;

ResponseFit MustFit(const Bench& bench, const ResponseFitOptions& options = {}) {
  Result<ResponseFit> fit = FitResponse(bench.Readings(), options);
  EXPECT_TRUE(fit) << fit.error().message;
  return fit ? *std::move(fit) : ResponseFit();
}

std::string ErrorOf(const ChartReadings& readings, const ResponseFitOptions& options = {}) {
  const Result<ResponseFit> fit = FitResponse(readings, options);
  return fit ? "none" : fit.error().message;
}

TEST(ResponseFit, MeasuresALinearSensor) {
  const ResponseFit fit = MustFit({.lights = 2});
  EXPECT_THAT(fit.warnings, ::testing::IsEmpty());
  EXPECT_NEAR(fit.black_dn, 512.0, 0.1);
  EXPECT_EQ(fit.saturation_dn, 15000.0);
  EXPECT_EQ(fit.white_dn, 15000.0);
  ASSERT_TRUE(fit.transfer);
  // 20 pairs of 5 patches of 2,304 sites, of which some half count: variances to 0.4 % together.
  EXPECT_NEAR(fit.transfer->gain_dn_per_electron, 0.4, 0.006);
  EXPECT_NEAR(fit.transfer->read_noise_dn, 2.0, 0.04);
  EXPECT_LT(fit.transfer->misfit, 1.3);
  EXPECT_GT(fit.transfer->misfit, 0.7);
  for (size_t light = 0; light < 2; ++light) {
    for (const Eigen::Index c : {0, 2}) {
      const double expected = 1.0 / (Bench().sensitivity[static_cast<size_t>(c)] *
                                     Bench::LightColour(light, static_cast<size_t>(c)));
      EXPECT_NEAR(fit.lights[light]->white_balance[c] / expected, 1.0, 1e-3);
      EXPECT_NEAR((fit.lights[light]->white_balance[c] - expected) / fit.lights[light]->sd[c], 0.0,
                  4.0);
    }
    EXPECT_EQ(fit.lights[light]->patches, kReflectance.size());
  }
  // All: the geometric mean.
  EXPECT_NEAR(fit.white_balance[0],
              std::sqrt(fit.lights[0]->white_balance[0] * fit.lights[1]->white_balance[0]), 1e-12);
  const double relative_sd = std::hypot(fit.lights[0]->sd[2] / fit.lights[0]->white_balance[2],
                                        fit.lights[1]->sd[2] / fit.lights[1]->white_balance[2]) /
                             2.0;
  EXPECT_NEAR(fit.white_balance_sd[2], fit.white_balance[2] * relative_sd, 1e-12);
  for (const ChannelLinearity& channel : fit.linearity.rgb) {
    EXPECT_FALSE(channel.departs);
    EXPECT_GT(channel.linear_to_dn, 0.8 * 15000.0);
    EXPECT_LT(channel.linear_from_dn, 512.0 + 60.0);
    EXPECT_GT(channel.linear_from_dn, 512.0);
  }
}

TEST(ResponseFit, StatesStandardDeviationsThatItsErrorsKeepTo) {
  // Ten sensors that differ in their noise alone.
  double gain = 0.0;
  double read = 0.0;
  constexpr int kRuns = 10;
  for (int run = 0; run < kRuns; ++run) {
    Bench bench{.gain = 0.4 + 0.01 * run,
                .read_noise_dn = 2.0 + 0.05 * run,
                .times_s = {0.002, 0.004, 0.0071},
                .seed = 1000 * (static_cast<uint64_t>(run) + 1)};
    bench.flicker = [](size_t frame) { return 1.0 + 1e-4 * static_cast<double>(frame % 3); };
    const PhotonTransfer transfer = *MustFit(bench).transfer;
    gain += std::pow((transfer.gain_dn_per_electron - bench.gain) / transfer.gain_sd, 2.0) / kRuns;
    read += std::pow((transfer.read_noise_dn - bench.read_noise_dn) / transfer.read_noise_sd, 2.0) /
            kRuns;
  }
  fmt::print("errors over predicted standard deviations: gain {:.2f}, read noise {:.2f}\n",
             std::sqrt(gain), std::sqrt(read));
  // A root mean square of ten is within 0.5 to 1.6 with a probability of 99 %.
  EXPECT_GT(std::sqrt(gain), 0.5);
  EXPECT_LT(std::sqrt(gain), 1.6);
  EXPECT_GT(std::sqrt(read), 0.5);
  EXPECT_LT(std::sqrt(read), 1.6);
}

TEST(ResponseFit, FindsWhereASensorBendsAndStopsThere) {
  Bench bench;
  // Off by 1 % at 8000 DN above black, growing with the square from 4000 on.
  bench.bend = [](double dn) {
    const double over = std::max(dn - 4000.0, 0.0) / 4000.0;
    return dn * (1.0 - 0.01 * over * over);
  };
  const ResponseFit fit = MustFit(bench);
  EXPECT_EQ(fit.saturation_dn, 15000.0);
  for (const ChannelLinearity& channel : fit.linearity.rgb) {
    EXPECT_TRUE(channel.departs);
  }
  // Noise and balance are of where it does not bend.
  EXPECT_NEAR(fit.transfer->gain_dn_per_electron, 0.4, 0.006);
  EXPECT_NEAR(fit.white_balance[0], 2.0, 0.003);
  // Slopes are of the first half of the range, in which it bends by 0.3 % on average.
  EXPECT_NEAR(fit.white_dn, 512.0 + 0.99 * 8000.0, 500.0);
  // A looser tolerance goes further: 3 % at 4000 (1 + sqrt 3).
  ResponseFitOptions loose;
  loose.linearity.tolerance = 0.03;
  const ResponseFit further = MustFit(bench, loose);
  EXPECT_NEAR(further.white_dn, 512.0 + 0.97 * 10928.0, 500.0);
  EXPECT_NEAR(further.transfer->gain_dn_per_electron, 0.4, 0.006);
  EXPECT_NEAR(further.white_balance[0], 2.0, 0.003);
}

// Off by 0.05 ((dn - 9000) / 9000)^2 from 9000 on: by 0.2 % at 10800, by 1 % at 13025. Exposures a
// sixteenth apart, up to where each colour saturates.
TEST(ResponseFit, SaysUpToWhereSheetsMayBeExposed) {
  Bench bench;
  bench.bend = [](double dn) {
    const double over = std::max(dn - 9000.0, 0.0) / 9000.0;
    return dn * (1.0 - 0.05 * over * over);
  };
  bench.times_s = {0.001, 0.002, 0.004};
  for (double time_s = 0.008; time_s < 0.07; time_s *= 1.0625) {
    bench.times_s.push_back(time_s);
  }
  // With a frame in the middle that is off its own time by more than the limit, too.
  for (const double flicker : {1.0, 1.003}) {
    bench.flicker = [flicker](size_t frame) { return frame == 13 ? flicker : 1.0; };
    for (const ChannelLinearity& channel : MustFit(bench).linearity.rgb) {
      ASSERT_TRUE(channel.fine_to_dn);
      fmt::print("within 0.2 % up to {:.0f} DN (true: 11290), within 1 % up to {:.0f} (13407)\n",
                 *channel.fine_to_dn, channel.linear_to_dn);
      EXPECT_NEAR(*channel.fine_to_dn, 512.0 + 0.998 * 10800.0, 200.0);  // noise of 0.03 % a bin
      EXPECT_NEAR(channel.linear_to_dn, 512.0 + 0.99 * 13025.0, 0.01 * 13407.0);
    }
  }
  // Where noise hides 0.1 %, nobody can tell.
  bench.gain = 40.0;
  for (const ChannelLinearity& channel : MustFit(bench).linearity.rgb) {
    EXPECT_FALSE(channel.fine_to_dn);
  }
}

// A frame that is 1.5 % brighter than its time says does not end the range: those beside it tell.
TEST(ResponseFit, OneBrighterFrameDoesNotEndTheLinearRange) {
  Bench bench;
  bench.flicker = [](size_t frame) { return frame == 7 ? 1.015 : 1.0; };
  const ResponseFit fit = MustFit(bench);
  EXPECT_EQ(fit.white_dn, 15000.0);
  for (const ChannelLinearity& channel : fit.linearity.rgb) {
    EXPECT_FALSE(channel.departs);
    EXPECT_GT(channel.linear_to_dn, 0.8 * 15000.0);
  }
}

TEST(ResponseFit, NoiseThatHidesTheRangeIsSaidSo) {
  Bench bench{.gain = 400.0, .repeats = 1};
  EXPECT_THAT(ErrorOf(bench.Readings()),
              HasSubstr("noise hides whether readings are proportional"));
}

// Below 200 DN it loses three tenths; 1 % at 580.
TEST(ResponseFit, BalanceIsOfWhereTheSensorIsLinear) {
  Bench bench;
  bench.bend = [](double dn) {
    return dn < 200.0 ? 0.7 * dn : dn - 60.0 * std::exp((200.0 - dn) / 150.0);
  };
  const ResponseFit fit = MustFit(bench);
  EXPECT_NEAR(fit.linearity.rgb[1].linear_from_dn, 512.0 + 580.0, 150.0);
  EXPECT_NEAR(fit.white_balance[0], 2.0, 0.004);
  EXPECT_NEAR(fit.white_balance[2], 1.0 / 0.7, 0.003);
}

// Saturated sites that differ by 20 sin: a median |deviation| of 14.1.
TEST(ResponseFit, SaturationIsBelowAllSaturatedSites) {
  Bench bench;
  bench.bend = [](double dn) { return dn > 14000.0 ? 14000.0 + 20.0 * std::sin(dn) : dn; };
  const ResponseFit fit = MustFit(bench);
  ASSERT_TRUE(fit.saturation_dn);
  EXPECT_NEAR(*fit.saturation_dn, 512.0 + 14000.0 - 3.0 * 1.4826 * 14.1, 5.0);
}

TEST(ResponseFit, TheColourThatSaturatesFirstIsWhite) {
  Bench bench;
  bench.times_s.push_back(0.08);  // saturates red too
  for (size_t first = 0; first < 3; ++first) {
    ChartReadings readings = bench.Readings();
    for (ChartFrame& frame : readings.frames) {
      for (std::vector<uint16_t>& dn : frame.dn) {
        for (size_t i = 0; i < dn.size(); ++i) {
          const bool is_first = readings.patches[0].colour[i] == first;
          dn[i] = std::min(dn[i], static_cast<uint16_t>(is_first ? 14000 : 15000));
        }
      }
    }
    const Result<ResponseFit> fit = FitResponse(readings);
    ASSERT_TRUE(fit) << fit.error().message;
    EXPECT_EQ(fit->saturation_dn, 14000.0) << first;
    EXPECT_EQ(fit->white_dn, 14000.0) << first;
  }
}

// A light of one exposure agrees with itself whatever the sensor does.
TEST(ResponseFit, OnlySeriesOfExposuresTellOfLinearity) {
  const size_t alone = MustFit({.lights = 1}).linearity.points.size();
  ChartReadings readings = Bench{.lights = 2}.Readings();
  std::erase_if(readings.frames, [](const ChartFrame& frame) {
    return frame.light == 1 && frame.exposure_s != 0.008;
  });
  const Result<ResponseFit> fit = FitResponse(readings);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_EQ(fit->linearity.points.size(), alone);
  EXPECT_TRUE(fit->lights[1]);
}

TEST(ResponseFit, AmbientLightGrowsWithTimeAndIsTakenOff) {
  const ResponseFit fit = MustFit({.ambient_dn_per_s = 50000.0});
  EXPECT_NEAR(fit.black_dn, 512.0, 0.3);
  EXPECT_NEAR(fit.white_balance[0], 2.0, 0.004);
  for (const ChannelLinearity& channel : fit.linearity.rgb) {
    EXPECT_FALSE(channel.departs);
  }
}

TEST(ResponseFit, WhatTheLightDoesOnTheChartDoesNotMatter) {
  Bench bench;
  bench.shading = [](size_t patch, int x, int y) {
    return 0.3 + 0.2 * static_cast<double>(patch) + 0.002 * x - 0.001 * y;
  };
  const ResponseFit fit = MustFit(bench);
  EXPECT_THAT(fit.uneven, ::testing::IsEmpty());
  EXPECT_NEAR(fit.white_balance[0], 2.0, 0.002);
  EXPECT_NEAR(fit.white_balance[2], 1.0 / 0.7, 0.0015);
  EXPECT_NEAR(fit.transfer->gain_dn_per_electron, 0.4, 0.008);
}

TEST(ResponseFit, ReflectancesThatAreNotEvenAreDividedOut) {
  ChartReadings readings = Bench().Readings();
  for (Eigen::Vector3d& rho : readings.reflectance_rgb) {
    rho[0] *= 1.05;  // the chart reflects 5 % more red than these sites were made with
  }
  const Result<ResponseFit> fit = FitResponse(readings);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->white_balance[0], 1.05 * 2.0, 0.003);
}

TEST(ResponseFit, AFrameOfAnotherExposureIsNamed) {
  ChartReadings readings = Bench().Readings();
  std::swap(readings.frames[4].dn, readings.frames[2].dn);  // 4 ms under 2 ms
  EXPECT_THAT(ErrorOf(readings), HasSubstr("times as bright as its"));
  EXPECT_THAT(ErrorOf(readings),
              ::testing::AnyOf(HasSubstr("its 0.002 s say by"), HasSubstr("its 0.004 s say by")));
  EXPECT_THAT(ErrorOf(readings),
              ::testing::AnyOf(HasSubstr("as bright as 0.002 s are; are frames swapped"),
                               HasSubstr("as bright as 0.004 s are; are frames swapped")));
}

TEST(ResponseFit, FlickerIsWarnedOf) {
  Bench bench;
  bench.flicker = [](size_t frame) { return frame == 7 ? 1.012 : 1.0; };
  const ResponseFit fit = MustFit(bench);
  EXPECT_THAT(fit.warnings, ::testing::Contains(HasSubstr("f7: is +1.2 % off its exposure time")));
}

TEST(ResponseFit, AnUnevenPatchIsLeftOutAndNamed) {
  for (const size_t dusty : {size_t{0}, size_t{2}}) {  // the first is saturated in many frames
    Bench bench;
    bench.shading = [&](size_t patch, int x, int y) {
      const double speck = patch == dusty && x < 6 && y < 6 ? 0.8 : 1.0;  // a speck of dust
      return speck * (1.0 + 0.004 * x - 0.003 * y);
    };
    const ResponseFit fit = MustFit(bench);
    ASSERT_EQ(fit.uneven.size(), 1U) << dusty;
    EXPECT_EQ(fit.uneven[0].patch, dusty);
    EXPECT_THAT(fit.warnings,
                ::testing::Contains(HasSubstr(fmt::format("patch 'p{}' is uneven by", dusty))));
    EXPECT_EQ(fit.lights[0]->patches, kReflectance.size() - 1);
  }
}

TEST(ResponseFit, ASensorThatCutsOffBelowBlackIsWarnedOf) {
  const ResponseFit fit = MustFit({.black_dn = 0.0});
  EXPECT_THAT(fit.warnings, ::testing::Contains(HasSubstr("cuts off values below black")));
  // From the lit pairs alone.
  EXPECT_NEAR(fit.transfer->gain_dn_per_electron, 0.4, 0.012);
}

TEST(ResponseFit, WithoutASaturatedPatchTheFilesWhiteStands) {
  const ResponseFit fit = MustFit({.times_s = {0.001, 0.002, 0.004, 0.008}});
  EXPECT_FALSE(fit.saturation_dn);
  EXPECT_EQ(fit.white_dn, 16383.0);
  EXPECT_THAT(fit.warnings, ::testing::Contains(HasSubstr("no patch is saturated")));
  EXPECT_THAT(fit.warnings, ::testing::Contains(HasSubstr("linearity is tested up to")));
}

TEST(ResponseFit, EqualFramesHaveNoNoiseToMeasure) {
  ChartReadings readings = Bench().Readings();
  for (size_t f = 0; f + 1 < readings.frames.size(); f += 2) {
    readings.frames[f + 1].dn = readings.frames[f].dn;  // one frame copied
  }
  for (ChartFrame& frame : readings.frames) {
    if (!frame.light) {
      frame.dn = readings.frames.back().dn;
    }
  }
  const Result<ResponseFit> fit = FitResponse(readings);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_FALSE(fit->transfer);
  EXPECT_THAT(fit->warnings, ::testing::Contains(HasSubstr("gain and read noise are left out")));
}

TEST(ResponseFit, ErrorsSayWhatIsMissing) {
  EXPECT_THAT(ErrorOf(Bench{.times_s = {0.004, 0.008}}.Readings()),
              HasSubstr("no light has frames of more than 2 exposure times"));
  EXPECT_THAT(ErrorOf(Bench{.dn_per_s = 1000.0}.Readings()), HasSubstr("did the light come on?"));
  EXPECT_THAT(ErrorOf(Bench{.dn_per_s = 4e9}.Readings()), HasSubstr("every patch is saturated"));
  ChartReadings no_dark = Bench().Readings();
  std::erase_if(no_dark.frames, [](const ChartFrame& frame) { return !frame.light; });
  EXPECT_THAT(ErrorOf(no_dark), HasSubstr("no dark frame"));
  const Bench curve{
      .bend = [](double dn) { return dn > 0.0 ? 16000.0 * std::pow(dn / 16000.0, 0.6) : dn; }};
  EXPECT_THAT(ErrorOf(curve.Readings()), HasSubstr("times as bright as its"));
  EXPECT_THAT(ErrorOf(Bench().Readings(), {.most_uneven = 0.0}), HasSubstr("most_uneven = 0"));
  EXPECT_THAT(ErrorOf(Bench().Readings(), {.most_off = 2.0}), HasSubstr("most_off = 2"));
  EXPECT_THAT(ErrorOf(Bench().Readings(), {.linearity = {.tolerance = 0.0}}),
              HasSubstr("tolerance = 0"));
}

}  // namespace
}  // namespace sateen::response_fit_test
