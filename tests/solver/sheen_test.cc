#include "solver/sheen.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numbers>
#include <random>

#include "reflectance/specular.h"
#include "tests/solver/ladder_cases.h"

namespace sateen {
namespace {

using testing::ErrorOf;
using testing::MustSolve;
using testing::Render;

constexpr Sheen kTrueSheen{.alpha = 0.55, .strength = 1.3};
constexpr ImageSize kSheenSize{64, 48};
constexpr double kElectrons = 400000.0;

// Adds the sheen of `share` of 100 pixels, and shot noise of `electrons` at full scale 0.1.
void AddSheen(const Rig& rig, int share, double electrons, RenderedRelief& rendered) {
  const Cloth cloth({.f0 = Eigen::Vector3d::Constant(0.04), .alpha = kTrueSheen.alpha});
  std::mt19937 random(3);
  for (size_t p = 0; p < kSheenSize.PixelCount(); ++p) {
    const auto column = static_cast<int>(p % kSheenSize.width);
    const auto row = static_cast<int>(p / kSheenSize.width);
    const Eigen::Vector3d v = ViewOf(rig, column, row).value();
    const Eigen::Vector3d x_mm = TablePointOfPixel(*rig.camera, column, row).value();
    const Eigen::Vector3d n(rendered.normal[0].pixels[p], rendered.normal[1].pixels[p],
                            rendered.normal[2].pixels[p]);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      const Incident incident = IncidentAt(rig.lights[k], x_mm);
      const double s = static_cast<int>(p % 100) < share
                           ? kTrueSheen.strength * std::numbers::pi *
                                 cloth.Evaluate(n, incident.l, v)[0] * n.dot(incident.l)
                           : 0.0;
      for (size_t c = 0; c < 3; ++c) {
        float& i = rendered.stack[k].rgb[c].pixels[p];
        // A body of a thirtieth of the albedo, so that the sheen is no smaller than it.
        const double clean =
            0.03 * static_cast<double>(i) + s * incident.e_rgb[static_cast<Eigen::Index>(c)];
        std::poisson_distribution<int> count(clean * electrons / 0.1);
        i = static_cast<float>(count(random) * 0.1 / electrons);
      }
    }
  }
}

LadderOptions WithShotNoise(double electrons, size_t frames) {
  LadderOptions options;
  options.noise = StackNoise(frames);
  for (SampleNoise& noise : *options.noise) {
    noise.shot.fill(0.1 / electrons);
    noise.read.fill(1e-9);
  }
  return options;
}

TEST(Sheen, IsFoundAndTakenOutOfTheNormal) {
  const Rig rig = RingRig(kSheenSize);
  RenderedRelief rendered = Render(rig, kSheenSize, 20.0);
  AddSheen(rig, 100, kElectrons, rendered);
  const LadderOptions options = WithShotNoise(kElectrons, rig.lights.size());
  const NormalField field = MustSolve(rendered.stack, rig, options);
  EXPECT_NEAR(field.summary.sheen_alpha, kTrueSheen.alpha, 0.03);
  EXPECT_NEAR(field.summary.sheen_strength, kTrueSheen.strength, 0.15);
  EXPECT_GT(field.summary.sheen.pixels, 3072 * 95 / 100);
  LadderOptions plain = options;
  plain.mode = LadderMode::kLeastSquares;
  EXPECT_LT(ErrorOf(field, rendered).mean,
            0.5 * ErrorOf(MustSolve(rendered.stack, rig, plain), rendered).mean);
}

TEST(Sheen, LambertianScenesHaveNone) {
  const Rig rig = RingRig(kSheenSize);
  RenderedRelief rendered = Render(rig, kSheenSize, 20.0);
  AddSheen(rig, 0, kElectrons, rendered);
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kElectrons, rig.lights.size()));
  EXPECT_EQ(field.summary.sheen_alpha, 0.0);
  EXPECT_EQ(field.summary.sheen.pixels, 0);
}

TEST(Sheen, IsNotBelievedWhereItLeavesATenthUnexplained) {
  const Rig rig = RingRig(kSheenSize);
  RenderedRelief rendered = Render(rig, kSheenSize, 20.0);
  testing::Spoil(rendered.stack, 3, 5);  // highlights and shadows
  AddSheen(rig, 100, kElectrons, rendered);
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kElectrons, rig.lights.size()));
  EXPECT_EQ(field.summary.sheen.pixels, 0);
  EXPECT_GT(field.summary.robust.pixels, 2000);
}

TEST(Sheen, AnyNumberOfThreadsGivesTheSameBits) {
  const Rig rig = RingRig(kSheenSize);
  RenderedRelief rendered = Render(rig, kSheenSize, 20.0);
  AddSheen(rig, 97, kElectrons, rendered);
  const LadderOptions options = WithShotNoise(kElectrons, rig.lights.size());
  const NormalField one = MustSolve(rendered.stack, rig, options, 1);
  EXPECT_GT(one.summary.sheen.pixels, 0);
  const NormalField many = MustSolve(rendered.stack, rig, options, 7);
  EXPECT_TRUE(testing::SameBits(one, many));
  EXPECT_EQ(one.model.pixels, many.model.pixels);
}

}  // namespace
}  // namespace sateen
