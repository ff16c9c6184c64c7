#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "solver/ladder.h"
#include "solver/robust/rungs.h"
#include "tests/solver/ladder_cases.h"

namespace sateen::consensus_test {
namespace {

using testing::DistantRig;
using testing::ErrorOf;
using testing::Forced;
using testing::MustSolve;
using testing::Render;
using testing::SetSample;
using testing::Spoil;
using testing::TwoRings;

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
              std::abs(fast.albedo_uncertainty.pixels[p] - plain.albedo_uncertainty.pixels[p]) <
                  0.01F * plain.albedo_uncertainty.pixels[p] &&
              fast.model.pixels[p] == plain.model.pixels[p];
          differ += same ? 0 : 1;
        }
        // Two triples that cost the same in double may not in float.
        EXPECT_LE(differ, 4) << "seed " << seed << " near " << near << " mode " << Name(mode);
      }
    }
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

// Coloured pixels of which each has its own number of usable samples and noise of its own. In every
// other block of 16 all samples but one have a white highlight, beside which that one counts as
// dark: there fewer samples of luminance are in the band than of the departure from grey.
RenderedRelief ColouredOfSixToEightSamples(const Rig& rig, ImageSize size, unsigned seed) {
  RenderedRelief rendered = Render(rig, size, 15.0);
  std::mt19937 random(seed);
  std::normal_distribution<float> grain(1.0F, 0.2F);
  std::uniform_real_distribution<float> lobe(0.6F, 1.2F);
  for (size_t p = 0; p < size.PixelCount(); ++p) {
    const size_t unusable = random() % 3;
    for (size_t k = 0; k < rendered.stack.size(); ++k) {
      const float body = rendered.stack[k].rgb[1].pixels[p] / rendered.albedo[1].pixels[p];
      const float white = p / 16 % 2 == 0 && k != unusable ? lobe(random) : 0.0F;
      const std::array<float, 3> red = {0.5F, 0.2F, 0.25F};
      for (size_t c = 0; c < 3; ++c) {
        rendered.stack[k].rgb[c].pixels[p] =
            k < unusable ? NAN : red[c] * body * grain(random) + white;
      }
    }
  }
  return rendered;
}

TEST(Consensus, APixelsAnswerDoesNotDependOnItsNeighbours) {
  for (const int count : {6, 7, 8}) {
    const ImageSize size{160, 100};
    const Rig rig = DistantRig(DistantRing(count, 40.0 * kRadPerDeg));
    const RenderedRelief rendered = ColouredOfSixToEightSamples(rig, size, 3);
    const LadderOptions options = Forced(LadderMode::kConsensus);
    const NormalField all = MustSolve(rendered.stack, rig, options);
    for (const size_t period : {2U, 3U, 5U, 17U, 97U}) {
      Mask mask(size, 0);
      for (size_t p = period / 2; p < mask.pixels.size(); p += period) {
        mask.pixels[p] = 255;
      }
      const NormalField some = SolveLadder(rendered.stack, rig, mask, options).value();
      int differ = 0;
      for (size_t p = period / 2; p < mask.pixels.size(); p += period) {
        bool same = all.uncertainty.pixels[p] == some.uncertainty.pixels[p] &&
                    all.residual.pixels[p] == some.residual.pixels[p] &&
                    all.model.pixels[p] == some.model.pixels[p];
        for (size_t c = 0; c < 3; ++c) {
          same = same && all.normal[c].pixels[p] == some.normal[c].pixels[p] &&
                 all.albedo[c].pixels[p] == some.albedo[c].pixels[p];
        }
        differ += same ? 0 : 1;
      }
      EXPECT_EQ(differ, 0) << count << " lights, every pixel of " << period;
    }
  }
}

TEST(Consensus, WhatFloatRefusesIsSolvedInDouble) {
  // Nine lights within 1 degree: condition number 81, which float vectors do not hold.
  Lights lights = DistantRing(9, 1.0 * kRadPerDeg);
  const Rig rig = DistantRig(std::move(lights));
  RenderedRelief rendered = Render(rig, {20, 10}, 15.0);
  for (size_t p = 0; p < 200; ++p) {
    SetSample(rendered.stack[p % 9], p, 0.05F);
  }
  const NormalField automatic = MustSolve(rendered.stack, rig);
  const NormalField plain =
      MustSolve(rendered.stack, rig, Forced(LadderMode::kAuto, Backend::kJacobiSvd));
  EXPECT_EQ(automatic.summary.robust.pixels, 200);
  EXPECT_EQ(automatic.summary.unexplained, 0);
  EXPECT_EQ(automatic.normal[0].pixels, plain.normal[0].pixels);
  EXPECT_EQ(automatic.model.pixels, plain.model.pixels);
  const NormalField fast =
      MustSolve(rendered.stack, rig, Forced(LadderMode::kAuto, Backend::kFast));
  EXPECT_EQ(fast.summary.solved, 0);
}

TEST(Consensus, IsNotSureOfItselfWhereTheWrongSamplesAgree) {
  // Six lights of ten see a flat surface, as light from the neighbourhood may show it: they agree
  // with each other, and the consensus is wrong by up to 40 degrees without any spread.
  const Rig rig = TwoRings();
  RenderedRelief rendered = Render(rig, {60, 40}, 40.0);
  const RenderedRelief flat = Render(rig, {60, 40}, 40.0, ReliefShape::kFlat);
  for (const size_t k : {0U, 2U, 3U, 5U, 6U, 8U}) {
    for (size_t c = 0; c < 3; ++c) {
      for (size_t p = 0; p < 2400; ++p) {
        rendered.stack[k].rgb[c].pixels[p] = flat.stack[k].rgb[c].pixels[p] *
                                             rendered.albedo[c].pixels[p] /
                                             flat.albedo[c].pixels[p];
      }
    }
  }
  const NormalField field = MustSolve(rendered.stack, rig, Forced(LadderMode::kConsensus));
  EXPECT_GT(ErrorOf(field, rendered).mean, 15.0);
  // (12): 0.4 of the angle to rung 1, or of the albedo's change, and more where samples are
  // rejected.
  const NormalField plain = MustSolve(rendered.stack, rig, Forced(LadderMode::kLeastSquares));
  size_t doubted = 0;
  size_t albedo_doubted = 0;
  for (size_t p = 0; p < 2400; ++p) {
    double cosine = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      cosine += static_cast<double>(field.normal[c].pixels[p] * plain.normal[c].pixels[p]);
    }
    const double turned_deg = std::acos(std::min(1.0, cosine)) * kDegPerRad;
    doubted +=
        static_cast<double>(field.uncertainty.pixels[p]) >= std::hypot(3.0, 0.4 * turned_deg) - 1e-3
            ? 1
            : 0;
    const double change =
        std::min(1.0, std::abs(static_cast<double>(AlbedoAt(plain, p) / AlbedoAt(field, p)) - 1.0));
    albedo_doubted += static_cast<double>(field.albedo_uncertainty.pixels[p]) >=
                              std::min(1.0, std::hypot(3.0 * kRadPerDeg, 0.4 * change)) - 1e-5
                          ? 1
                          : 0;
  }
  EXPECT_EQ(doubted, 2400U);
  EXPECT_EQ(albedo_doubted, 2400U);
}

// Two pixels whose search has no answer and one: they keep rung 1's normal, but not its word on it.
TEST(Consensus, APixelWithoutAnAnswerSaysSo) {
  NormalField field;
  field.Resize({2, 1});
  field.samples.pixels = {7, 7};
  field.model = Image<uint8_t>(ImageSize{2, 1});
  field.uncertainty = Image<float>(ImageSize{2, 1}, 0.05F);
  field.albedo_uncertainty = Image<float>(ImageSize{2, 1}, 0.001F);
  const std::vector<Estimate> same(2, Estimate{Eigen::Vector3f::UnitZ(), 1.0F});
  const std::array<size_t, 2> pixels = {0, 1};
  const std::array<uint8_t, 2> agreeing = {0, 3};
  PieceSummary summary;
  JudgeConsensus(pixels, same, same, agreeing, field, summary);
  EXPECT_GE(field.uncertainty.pixels[0], 60.0F);
  EXPECT_EQ(field.albedo_uncertainty.pixels[0], 1.0F);
  // (2 - 3 / 7) times three; of the albedo 0.05 for gloss.
  EXPECT_NEAR(field.uncertainty.pixels[1], 0.05 * 11.0 / 7.0 * 3.0, 1e-5);
  EXPECT_NEAR(field.albedo_uncertainty.pixels[1], std::hypot(0.001 * 33.0 / 7.0, 0.05), 1e-5);
  EXPECT_EQ(field.model.pixels[0], static_cast<uint8_t>(Rung::kUnexplained));
  EXPECT_EQ(summary.unexplained, 2);
}

TEST(Consensus, RungOneIsDoubtedAsMuchAsPixelsClimb) {
  // Spoils so many of 100 rows; in the others least squares are exact.
  const Rig rig = TwoRings();
  const auto solve = [&](int spoiled_rows) {
    RenderedRelief rendered = Render(rig, {40, 100}, 15.0);
    RenderedRelief spoiled = rendered;
    Spoil(spoiled.stack, 3, 5);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      for (size_t c = 0; c < 3; ++c) {
        std::copy_n(spoiled.stack[k].rgb[c].pixels.begin(), 40 * spoiled_rows,
                    rendered.stack[k].rgb[c].pixels.begin());
      }
    }
    return MustSolve(rendered.stack, rig);
  };
  const auto doubt = [&](int spoiled_rows) { return solve(spoiled_rows).uncertainty.At(20, 95); };
  const auto albedo_doubt = [&](int spoiled_rows) {
    return solve(spoiled_rows).albedo_uncertainty.At(20, 95);
  };
  EXPECT_LT(albedo_doubt(1), 2e-4F);
  EXPECT_GT(albedo_doubt(11), 0.025F);
  EXPECT_LT(albedo_doubt(11), 0.7F * albedo_doubt(30));
  EXPECT_LT(doubt(1), 0.01F);
  EXPECT_GT(doubt(11), 1.5F);
  EXPECT_LT(doubt(11), 0.7F * doubt(30));
  EXPECT_GT(doubt(30), 3.0F);
}

}  // namespace
}  // namespace sateen::consensus_test
