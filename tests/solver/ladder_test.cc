#include "solver/ladder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <random>

#include "core/angle.h"
#include "imaging/color.h"
#include "simulation/relief.h"
#include "simulation/rigs.h"
#include "tests/solver/solver_cases.h"

namespace sateen {
namespace {

using testing::DistantRig;
using testing::ReasonAt;
using testing::Render;
using testing::SameBits;
using testing::SetSample;

// Ten lights at two heights: samples of three of them are never in one plane with the camera.
Rig TwoRings() {
  Lights lights = DistantRing(5, 25.0 * kRadPerDeg);
  for (const Light& light : DistantRing(5, 50.0 * kRadPerDeg)) {
    lights.push_back(light);
  }
  for (size_t k = 5; k < lights.size(); ++k) {
    const Eigen::AngleAxisd turn(0.6, Eigen::Vector3d::UnitZ());
    lights[k].direction = turn * lights[k].direction;
    lights[k].name = fmt::format("outer-{}", k);
    lights[k].channel = static_cast<int>(k);
  }
  return DistantRig(std::move(lights));
}

LadderOptions Forced(LadderMode mode, Backend backend = Backend::kAuto) {
  return {.mode = mode, .least_squares = {.backend = backend}};
}

NormalField MustSolve(const LightStack& stack, const Rig& rig, const LadderOptions& options = {},
                      int threads = 0) {
  return SolveLadder(stack, rig, std::nullopt, options, {.threads = threads}).value();
}

ErrorStatistics ErrorOf(const NormalField& field, const RenderedRelief& truth) {
  return AngularErrorDeg(field, truth.normal).value();
}

// Multiplies `spoiled` samples of every pixel, other ones from pixel to pixel: highlights and
// shadows of all sizes.
void Spoil(LightStack& stack, int spoiled, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<size_t> lights(stack.size());
  for (size_t k = 0; k < lights.size(); ++k) {
    lights[k] = k;
  }
  std::uniform_real_distribution<double> shadow(0.5, 0.8);
  std::uniform_real_distribution<double> highlight(1.5, 20.0);
  for (size_t p = 0; p < stack[0].rgb[0].pixels.size(); ++p) {
    std::shuffle(lights.begin(), lights.end(), random);
    for (int j = 0; j < spoiled; ++j) {
      const auto factor = static_cast<float>(j % 3 == 2 ? shadow(random) : highlight(random));
      for (Image<float>& plane : stack[lights[static_cast<size_t>(j)]].rgb.planes) {
        plane.pixels[p] *= factor;
      }
    }
  }
}

// The noise of RenderRelief's sensor.
StackNoise NoiseOf(const SensorModel& sensor, size_t frames) {
  SampleNoise noise;
  const double unit = sensor.full_scale / sensor.electrons;
  const double step = sensor.full_scale / (std::exp2(sensor.bits) - 1.0);
  noise.shot.fill(unit);
  noise.read.fill(
      std::sqrt(unit * unit * sensor.read_noise_electrons * sensor.read_noise_electrons +
                step * step / 12.0));
  return StackNoise(frames, noise);
}

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

struct Noisy {
  Rig rig;
  RenderedRelief rendered;
  StackNoise noise;
};

Noisy NoisyScene(double exposure, unsigned seed, double max_slope_deg = 20.0) {
  const SensorModel sensor{.full_scale = exposure};
  Noisy noisy{TwoRings(), {}, NoiseOf(sensor, 10)};
  noisy.rendered = RenderRelief({.shape = ReliefShape::kRipple,
                                 .max_slope_rad = max_slope_deg * kRadPerDeg,
                                 .sensor = sensor,
                                 .seed = seed},
                                noisy.rig, {160, 100})
                       .value();
  return noisy;
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

TEST(SolveLadder, UncertaintyIsTheActualErrorOverTwentyScenes) {
  // A factor of 1.2 in the uncertainty would be outside.
  for (unsigned scene_number = 0; scene_number < 20; ++scene_number) {
    const Noisy scene = NoisyScene(1.0 + scene_number, scene_number, 5.0 + scene_number);
    for (const bool known : {true, false}) {
      LadderOptions options;
      if (known) {
        options.noise = scene.noise;
      }
      const NormalField field = MustSolve(scene.rendered.stack, scene.rig, options);
      Image<float> error;
      ASSERT_TRUE(AngularErrorDeg(field, scene.rendered.normal, &error));
      double squares = 0.0;
      int64_t inside = 0;
      int64_t count = 0;
      for (size_t p = 0; p < error.pixels.size(); ++p) {
        const double z = static_cast<double>(error.pixels[p] / field.uncertainty.pixels[p]);
        squares += z * z;
        inside += z <= 1.96 ? 1 : 0;
        ++count;
      }
      const double standardised = std::sqrt(squares / static_cast<double>(count));
      // Unknown: read noise counts as shot noise, and the 5th percentile is one of 800 pixels.
      EXPECT_NEAR(standardised, 1.0, known ? 0.05 : 0.1)
          << scene_number << (known ? "" : " unknown");
      EXPECT_GE(inside, 0.94 * static_cast<double>(count)) << scene_number;
    }
  }
}

TEST(SolveLadder, WeightsDoNotBias) {
  // Weights from the samples themselves would draw albedo and slope down by about one part in the
  // electrons of a sample: 2 % at the 50 electrons here. The mean of 16,000 pixels is good to 0.2 %.
  const SensorModel sensor{.full_scale = 1.0, .electrons = 150.0, .read_noise_electrons = 1.0};
  const Rig rig = TwoRings();
  const RenderedRelief rendered =
      RenderRelief(
          {.shape = ReliefShape::kFlat, .albedo_min = 0.5, .albedo_max = 0.5, .sensor = sensor},
          rig, {160, 100})
          .value();
  LadderOptions options = Forced(LadderMode::kLeastSquares);
  options.noise = NoiseOf(sensor, rig.lights.size());
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

TEST(SolveLadder, RecoversExactlyFromAsManyOutliersAsLeaveFourSamples) {
  // Four samples that agree exactly against any number that do not: the product of (9) is least.
  for (const Backend backend : {Backend::kAuto, Backend::kJacobiSvd}) {
    for (const int spoiled : {1, 2, 3, 4}) {
      const Rig rig = TwoRings();
      RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
      Spoil(rendered.stack, spoiled, 11);
      LadderOptions options;
      options.least_squares.backend = backend;
      const NormalField field = MustSolve(rendered.stack, rig, options);
      const ErrorStatistics error = ErrorOf(field, rendered);
      EXPECT_EQ(error.count, 1200);
      // The weights of (10) leave an outlier of half a median 1 part in 700 of its pull.
      EXPECT_LT(error.median, 0.1) << spoiled << " spoiled";
      EXPECT_LT(error.p99, 3.0) << spoiled << " spoiled";
      EXPECT_GT(field.summary.robust.pixels, 1190);
    }
  }
}

TEST(SolveLadder, FastAgreesWithThePlainForm) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    for (const bool near : {false, true}) {
      const ImageSize size{37, 21};
      const Rig rig = near ? RingRig(size) : TwoRings();
      RenderedRelief rendered = Render(rig, size, 20.0);
      Spoil(rendered.stack, 3, seed);
      for (const LadderMode mode : {LadderMode::kLeastSquares, LadderMode::kConsensus}) {
        const NormalField fast = MustSolve(rendered.stack, rig, Forced(mode));
        const NormalField plain = MustSolve(rendered.stack, rig, Forced(mode, Backend::kJacobiSvd));
        int differ = 0;
        for (size_t p = 0; p < fast.model.pixels.size(); ++p) {
          const auto at = [&](const Image3& image) {
            return Eigen::Vector3f(image[0].pixels[p], image[1].pixels[p], image[2].pixels[p]);
          };
          const bool same =
              (at(fast.normal) - at(plain.normal)).norm() < 2e-4F &&
              (at(fast.albedo) - at(plain.albedo)).norm() < 1e-3F * at(plain.albedo).norm() &&
              std::abs(fast.uncertainty.pixels[p] - plain.uncertainty.pixels[p]) <
                  0.01F * plain.uncertainty.pixels[p] &&
              fast.model.pixels[p] == plain.model.pixels[p];
          differ += same ? 0 : 1;
        }
        // Two triples that cost the same in double may not in float.
        EXPECT_LE(differ, 4) << "seed " << seed << " near " << near << " mode " << Name(mode);
      }
    }
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
    EXPECT_EQ(one.model.pixels, many.model.pixels);
  }
}

TEST(SolveLadder, WhiteHighlightsOnColourCostNothing) {
  // A lobe on every sample, different from light to light, that is white: no four samples of
  // luminance agree, all of the departure from grey do.
  const Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> lobe(0.02F, 0.3F);
  for (size_t p = 0; p < rendered.albedo[0].pixels.size(); ++p) {
    for (LightFrame& frame : rendered.stack) {
      const float body = frame.rgb[1].pixels[p] / rendered.albedo[1].pixels[p];
      const float white = lobe(random);
      const std::array<float, 3> red = {0.5F, 0.1F, 0.12F};
      for (size_t c = 0; c < 3; ++c) {
        frame.rgb[c].pixels[p] = red[c] * body + white;
      }
    }
  }
  const ErrorStatistics error =
      ErrorOf(MustSolve(rendered.stack, rig, Forced(LadderMode::kConsensus)), rendered);
  EXPECT_LT(error.p99, 0.01);
}

TEST(SolveLadder, PixelsInWhichNoFourSamplesAgreeAreMarked) {
  const Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {40, 30}, 15.0);
  std::mt19937 random(8);
  std::uniform_real_distribution<float> any(-3.0F, 3.0F);
  for (size_t p = 0; p < 1200; ++p) {
    for (LightFrame& frame : rendered.stack) {
      SetSample(frame, p, std::exp(any(random)));
    }
  }
  const NormalField field = MustSolve(rendered.stack, rig);
  int doubtful = 0;
  for (size_t p = 0; p < 1200; ++p) {
    doubtful += field.model.pixels[p] == static_cast<uint8_t>(Rung::kUnexplained) ||
                        field.uncertainty.pixels[p] > 10.0F
                    ? 1
                    : 0;
  }
  EXPECT_GT(doubtful, 900);  // in the others four of ten agree by chance
  EXPECT_GT(field.summary.unexplained, 0);
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

TEST(SolveLadder, ChiSquaredQuantiles) {
  // Tables: 95 % of 7 degrees of freedom 14.067, 25 % 4.255, 99.9 % 24.322; 5 % of 93 71.76.
  EXPECT_NEAR(ChiSquaredQuantile(0.95, 7) * 7.0, 14.067, 0.05);
  EXPECT_NEAR(ChiSquaredQuantile(0.25, 7) * 7.0, 4.255, 0.05);
  EXPECT_NEAR(ChiSquaredQuantile(0.999, 7) * 7.0, 24.322, 0.25);
  EXPECT_NEAR(ChiSquaredQuantile(0.05, 93) * 93.0, 71.76, 0.2);
  EXPECT_NEAR(ChiSquaredQuantile(0.05, 1), 0.00393, 1e-5);
  EXPECT_NEAR(ChiSquaredQuantile(0.999, 1), 10.828, 1e-3);
  EXPECT_NEAR(ChiSquaredQuantile(0.05, 2) * 2.0, 0.10259, 1e-5);
  EXPECT_NEAR(ChiSquaredQuantile(0.999, 2) * 2.0, 13.816, 1e-3);
  // The cube root is at its worst.
  EXPECT_NEAR(ChiSquaredQuantile(0.05, 3) * 3.0, 0.35185, 0.07 * 0.35185);
  EXPECT_NEAR(ChiSquaredQuantile(0.999, 3) * 3.0, 16.266, 0.02 * 16.266);
}

// Root mean square of the actual angles over that of the uncertainties, where rung 1 gives them; 1 =
// honest.
double ActualOverReported(const NormalField& field, const RenderedRelief& truth) {
  Image<float> error;
  EXPECT_TRUE(AngularErrorDeg(field, truth.normal, &error));
  double actual = 0.0;
  double reported = 0.0;
  for (size_t p = 0; p < error.pixels.size(); ++p) {
    if (ReasonAt(field, p) == Reason::kSolved &&
        field.model.pixels[p] <= static_cast<uint8_t>(Rung::kUnchecked)) {
      actual += std::pow(static_cast<double>(error.pixels[p]), 2.0);
      reported += std::pow(static_cast<double>(field.uncertainty.pixels[p]), 2.0);
    }
  }
  return std::sqrt(actual / reported);
}

RenderedRelief RippleOf(const SensorModel& sensor, const Rig& rig, ImageSize size) {
  return RenderRelief(
             {.shape = ReliefShape::kRipple, .max_slope_rad = 15.0 * kRadPerDeg, .sensor = sensor},
             rig, size)
      .value();
}

TEST(SolveLadder, ASmallMaskInALargeImageHasItsOwnNoise) {
  const Rig rig = TwoRings();
  const ImageSize size{1008, 690};  // every 42nd pixel of the image would miss the mask
  const RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, size);
  Mask mask(size, 0);
  for (int y = 300; y < 310; ++y) {
    for (int x = 505; x < 515; ++x) {
      mask.At(x, y) = 255;
    }
  }
  const NormalField field = SolveLadder(rendered.stack, rig, mask).value();
  EXPECT_EQ(field.summary.solved, 100);
  EXPECT_NEAR(ActualOverReported(field, rendered), 1.0, 0.4);
}

TEST(SolveLadder, NeighboursTellTheNoiseOfThreeLights) {
  const Rig rig = DistantRig(DistantRing(3, 40.0 * kRadPerDeg));
  const RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, {160, 100});
  const NormalField field = MustSolve(rendered.stack, rig);
  EXPECT_EQ(field.summary.unchecked, 16000);
  EXPECT_GT(ActualOverReported(field, rendered), 0.5);
  EXPECT_LT(ActualOverReported(field, rendered), 1.5);
}

TEST(SolveLadder, UncertaintyIsUnknownWhereNothingTellsOfTheNoise) {
  const Rig rig = DistantRig(DistantRing(3, 40.0 * kRadPerDeg));
  const RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, {2, 3});  // no neighbours
  Mask mask({2, 3}, 255);
  mask.At(0, 0) = 0;
  const NormalField field = SolveLadder(rendered.stack, rig, mask).value();
  EXPECT_EQ(field.uncertainty.At(0, 0), 0.0F);
  EXPECT_EQ(field.uncertainty.At(1, 0), 180.0F);
  EXPECT_EQ(field.summary.least_squares.mean_uncertainty_deg, 180.0);
  EXPECT_EQ(field.summary.noise_scale, 0.0);
}

TEST(SolveLadder, SmoothFramesOfEightBitsAreNotWithoutNoise) {
  const SensorModel eight_bits{.bits = 8, .electrons = 1e9, .read_noise_electrons = 0.0};
  for (const int count : {3, 4, 10}) {
    const Rig rig = count == 10 ? TwoRings() : DistantRig(DistantRing(count, 40.0 * kRadPerDeg));
    for (const double period_px : {40.0, 400.0}) {
      const RenderedRelief rendered = RenderRelief({.shape = ReliefShape::kRipple,
                                                    .max_slope_rad = 15.0 * kRadPerDeg,
                                                    .ripple_period_px = period_px,
                                                    .sensor = eight_bits},
                                                   rig, {400, 300})
                                          .value();
      const NormalField field = MustSolve(rendered.stack, rig);
      EXPECT_GT(ActualOverReported(field, rendered), 1.0 / 3.0) << count << ", " << period_px;
      EXPECT_LT(ActualOverReported(field, rendered), 3.0) << count << ", " << period_px;
      EXPECT_LT(field.summary.robust.pixels, 120000 / 20) << count << ", " << period_px;
    }
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
    options.false_alarms = bad;
    const Result<NormalField> field = SolveLadder(rendered.stack, rig, std::nullopt, options);
    ASSERT_FALSE(field);
    EXPECT_NE(field.error().message.find("false_alarms"), std::string::npos);
  }
  LadderOptions options;
  options.noise = StackNoise(3);
  EXPECT_EQ(SolveLadder(rendered.stack, rig, std::nullopt, options).error().code,
            ErrorCode::kBadData);
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
  stack[0].full_scale = 30.0F;  // of red, the largest: 2e-3 a DN, green half of that
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
}  // namespace sateen
