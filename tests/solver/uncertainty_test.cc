#include <gtest/gtest.h>

#include <cmath>

#include "solver/ladder.h"
#include "tests/solver/ladder_cases.h"

namespace sateen::uncertainty_test {
namespace {

using testing::DistantRig;
using testing::MustSolve;
using testing::Noisy;
using testing::NoisyScene;
using testing::ReasonAt;
using testing::RippleOf;
using testing::TwoRings;

// Root mean square of the albedo's error over its uncertainty; 1 = honest.
double StandardisedAlbedoError(const NormalField& field, const RenderedRelief& truth) {
  const Image<float> error = AlbedoErrorMap(field, truth.albedo).value();
  double squares = 0.0;
  for (size_t p = 0; p < error.pixels.size(); ++p) {
    squares +=
        std::pow(static_cast<double>(error.pixels[p] / field.albedo_uncertainty.pixels[p]), 2);
  }
  return std::sqrt(squares / static_cast<double>(error.pixels.size()));
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
      EXPECT_NEAR(StandardisedAlbedoError(field, scene.rendered), 1.0, known ? 0.03 : 0.1)
          << scene_number << (known ? "" : " unknown");
    }
  }
}

// Root mean square of the actual angles over that of the uncertainties, where rung 1 gives them; 1
// = honest.
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
  EXPECT_EQ(field.albedo_uncertainty.At(0, 0), 0.0F);
  EXPECT_EQ(field.albedo_uncertainty.At(1, 0), 1.0F);
  EXPECT_EQ(field.summary.least_squares.mean_uncertainty_deg, 180.0);
  EXPECT_EQ(field.summary.noise_scale, 0.0);
}

// By hand from the normals at some pixels: inside, at the border, beside one that is masked out.
TEST(SolveLadder, UncertaintyOfInterpolatedColoursHoldsHowNormalsBend) {
  const Rig rig = TwoRings();
  RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, {60, 40});
  Mask mask({60, 40}, 255);
  mask.At(20, 10) = 0;
  const NormalField plain = SolveLadder(rendered.stack, rig, mask).value();
  for (LightFrame& frame : rendered.stack) {
    frame.raw = true;
  }
  const NormalField raw = SolveLadder(rendered.stack, rig, mask).value();
  const auto normal = [&](int x, int y) {
    return Eigen::Vector3d(static_cast<double>(raw.normal[0].At(x, y)),
                           static_cast<double>(raw.normal[1].At(x, y)),
                           static_cast<double>(raw.normal[2].At(x, y)));
  };
  const auto bend = [&](int x, int y, int dx, int dy) {
    return (normal(x - dx, y - dy) - 2.0 * normal(x, y) + normal(x + dx, y + dy)).squaredNorm();
  };
  const auto expect = [&](int x, int y, double bend_squared) {
    const auto before = static_cast<double>(plain.uncertainty.At(x, y));
    EXPECT_NEAR(static_cast<double>(raw.uncertainty.At(x, y)),
                std::hypot(before, 0.5 * std::sqrt(bend_squared) * kDegPerRad), 1e-4)
        << x << ", " << y;
  };
  expect(30, 20, bend(30, 20, 1, 0) + bend(30, 20, 0, 1));
  expect(0, 20, 4.0 * (normal(1, 20) - normal(0, 20)).squaredNorm() + bend(0, 20, 0, 1));
  expect(21, 10, 4.0 * (normal(22, 10) - normal(21, 10)).squaredNorm() + bend(21, 10, 0, 1));
  expect(20, 11, bend(20, 11, 1, 0) + 4.0 * (normal(20, 12) - normal(20, 11)).squaredNorm());
  EXPECT_EQ(raw.uncertainty.At(20, 10), 0.0F);
  // The same of the albedo's luminance, over that of the pixel.
  const auto albedo = [&](int x, int y) {
    return 0.2126 * static_cast<double>(raw.albedo[0].At(x, y)) +
           0.7152 * static_cast<double>(raw.albedo[1].At(x, y)) +
           0.0722 * static_cast<double>(raw.albedo[2].At(x, y));
  };
  const double in_x = albedo(29, 20) - 2.0 * albedo(30, 20) + albedo(31, 20);
  const double in_y = albedo(30, 19) - 2.0 * albedo(30, 20) + albedo(30, 21);
  EXPECT_NEAR(static_cast<double>(raw.albedo_uncertainty.At(30, 20)),
              std::hypot(static_cast<double>(plain.albedo_uncertainty.At(30, 20)),
                         0.5 * std::hypot(in_x, in_y) / albedo(30, 20)),
              1e-6);
  EXPECT_EQ(raw.albedo_uncertainty.At(20, 10), 0.0F);
  EXPECT_GT(raw.summary.least_squares.mean_uncertainty_deg,
            plain.summary.least_squares.mean_uncertainty_deg);
  EXPECT_EQ(raw.normal[0].pixels, plain.normal[0].pixels);
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

}  // namespace
}  // namespace sateen::uncertainty_test
