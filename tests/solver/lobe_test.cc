#include "solver/lobe/lobe.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "reflectance/specular.h"
#include "rig/projection.h"
#include "solver/lobe/lobe_search.h"
#include "tests/solver/ladder_cases.h"

namespace sateen::lobe_test {
namespace {

using testing::ErrorOf;
using testing::MustSolve;
using testing::Render;

constexpr Lobe kFuzz{.model = LobeModel::kCloth, .alpha = 0.55, .strength = 1.3};
constexpr Lobe kGloss{.model = LobeModel::kGgx, .alpha = 0.25, .strength = 0.8};
constexpr Lobe kYarns{.model = LobeModel::kGgxAnisotropic,
                      .alpha = 0.35,
                      .strength = 1.2,
                      .alpha_along = 0.14,
                      .azimuth_deg = 30.0};
constexpr ImageSize kLobeSize{64, 48};
constexpr double kElectrons = 400000.0;

// (1) of solver/lobe/lobe.h by reflectance/.
double ValueByReflectance(const Lobe& lobe, const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                          const Eigen::Vector3d& v) {
  const SpecularSpec spec{.f0 = Eigen::Vector3d::Constant(0.04), .alpha = lobe.alpha};
  const double azimuth = lobe.azimuth_deg * kRadPerDeg;
  const AnisotropicSpec of_yarns{.f0 = spec.f0,
                                 .alpha = lobe.alpha,
                                 .anisotropy = 1.0 - lobe.alpha_along / lobe.alpha,
                                 .tangent = {std::cos(azimuth), std::sin(azimuth), 0.0}};
  const double f = lobe.model == LobeModel::kCloth ? Cloth(spec).Evaluate(n, l, v)[0]
                   : lobe.model == LobeModel::kGgx ? Ggx(spec).Evaluate(n, l, v)[0]
                                                   : GgxAnisotropic(of_yarns).Evaluate(n, l, v)[0];
  return lobe.strength * std::numbers::pi * f * std::max(0.0, n.dot(l));
}

// Over a body of so much of the albedo that the lobe is no smaller than it.
double BodyUnder(const Lobe& lobe) { return lobe.model == LobeModel::kGgxAnisotropic ? 0.2 : 0.03; }

// Adds the lobe of `share` of 100 pixels, and shot noise of `electrons` at full scale 0.1.
void AddLobe(const Rig& rig, const Lobe& lobe, int share, double electrons,
             RenderedRelief& rendered) {
  std::mt19937 random(3);
  for (size_t p = 0; p < kLobeSize.PixelCount(); ++p) {
    const auto column = static_cast<int>(p % kLobeSize.width);
    const auto row = static_cast<int>(p / kLobeSize.width);
    const Eigen::Vector3d v = ViewOf(rig, column, row).value();
    const Eigen::Vector3d x_mm = TablePointOfPixel(*rig.camera, column, row).value();
    const Eigen::Vector3d n(rendered.normal[0].pixels[p], rendered.normal[1].pixels[p],
                            rendered.normal[2].pixels[p]);
    Lobe of_pixel = lobe;
    of_pixel.azimuth_deg += column / 8 % 2 == 0 ? 0.0 : 90.0;  // warp and weft
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      const Incident incident = IncidentAt(rig.lights[k], x_mm);
      const double s =
          static_cast<int>(p % 100) < share ? ValueByReflectance(of_pixel, n, incident.l, v) : 0.0;
      for (size_t c = 0; c < 3; ++c) {
        float& i = rendered.stack[k].rgb[c].pixels[p];
        const double clean = BodyUnder(lobe) * static_cast<double>(i) +
                             s * incident.e_rgb[static_cast<Eigen::Index>(c)];
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

TEST(Lobe, IsThatOfTheReflectanceModelAndItsGradient) {
  std::mt19937 random(5);
  std::normal_distribution<double> deviate;
  const auto direction = [&](double spread) {
    return Eigen::Vector3d(spread * deviate(random), spread * deviate(random), 1.0).normalized();
  };
  for (const LobeModel model : {LobeModel::kCloth, LobeModel::kGgx, LobeModel::kGgxAnisotropic}) {
    for (const double alpha : {0.1, 0.3, 0.7, 1.0}) {
      const Lobe lobe{.model = model,
                      .alpha = alpha,
                      .strength = 1.7,
                      .alpha_along = 0.45 * alpha,
                      .azimuth_deg = 65.0};
      for (int draw = 0; draw < 100; ++draw) {
        const Eigen::Vector3d n = direction(0.5);
        const Eigen::Vector3d l = direction(1.0);
        const Eigen::Vector3d v = direction(0.1);
        const LobeTerm term = LobeShape(lobe).At(n, l, v, LobeHalfOf(l, v));
        const double value = ValueByReflectance(lobe, n, l, v);
        ASSERT_NEAR(term.value, value, 1e-9 * value + 1e-12) << Name(model) << " " << alpha;
        if (n.dot(l) < 0.05 || n.dot(v) < 0.05) {
          continue;  // beside a kink
        }
        constexpr double kStep = 1e-6;
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
          // Across n, where the model is one of unit normals.
          const Eigen::Vector3d across =
              Eigen::Vector3d::Unit(axis) - n * n.dot(Eigen::Vector3d::Unit(axis));
          const double slope = (ValueByReflectance(lobe, (n + kStep * across).normalized(), l, v) -
                                ValueByReflectance(lobe, (n - kStep * across).normalized(), l, v)) /
                               (2.0 * kStep);
          ASSERT_NEAR(term.gradient.dot(across), slope, 1e-4 * std::abs(slope) + 1e-5)
              << Name(model) << " " << alpha;
        }
      }
    }
  }
}

TEST(Lobe, IsFoundAndTakenOutOfNormalAndAlbedo) {
  const Rig rig = RingRig(kLobeSize);
  for (const Lobe& lobe : {kFuzz, kGloss, kYarns}) {
    RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
    AddLobe(rig, lobe, 100, kElectrons, rendered);
    for (Image<float>& plane : rendered.albedo.planes) {
      for (float& rho : plane.pixels) {
        rho *= static_cast<float>(BodyUnder(lobe));
      }
    }
    const LadderOptions options = WithShotNoise(kElectrons, rig.lights.size());
    const NormalField field = MustSolve(rendered.stack, rig, options);
    ASSERT_TRUE(field.summary.lobe);
    EXPECT_EQ(field.summary.lobe->model, lobe.model);
    EXPECT_NEAR(field.summary.lobe->alpha, lobe.alpha, 0.03);
    EXPECT_NEAR(field.summary.lobe->strength, lobe.strength, 0.15);
    if (lobe.model == LobeModel::kGgxAnisotropic) {
      EXPECT_NEAR(field.summary.lobe->alpha_along, lobe.alpha_along, 0.03);
      EXPECT_NEAR(std::fmod(field.summary.lobe->azimuth_deg, 90.0), lobe.azimuth_deg, 3.0);
    }
    EXPECT_GT(field.summary.under_lobe.pixels, 3072 * 9 / 10);
    LadderOptions plain = options;
    plain.mode = LadderMode::kLeastSquares;
    const NormalField without = MustSolve(rendered.stack, rig, plain);
    EXPECT_LT(ErrorOf(field, rendered).mean, 0.5 * ErrorOf(without, rendered).mean);
    EXPECT_LT(RelativeAlbedoError(field, rendered.albedo).value().mean, 0.1);
    EXPECT_GT(RelativeAlbedoError(without, rendered.albedo).value().mean, 0.4);
    // Nine of ten errors of the albedo lie within 1.96 of its uncertainty, and that is not idle.
    const Image<float> error = AlbedoErrorMap(field, rendered.albedo).value();
    int64_t inside = 0;
    int64_t unsure = 0;
    for (size_t p = 0; p < error.pixels.size(); ++p) {
      inside += error.pixels[p] <= 1.96F * field.albedo_uncertainty.pixels[p] ? 1 : 0;
      unsure += field.albedo_uncertainty.pixels[p] > 0.5F ? 1 : 0;
    }
    EXPECT_GT(inside, 3072 * 9 / 10) << Name(lobe.model);
    EXPECT_LT(unsure, 3072 / 10) << Name(lobe.model);
  }
}

// Root mean square of error over uncertainty, of normals and of albedo.
std::pair<double, double> StandardisedErrors(const NormalField& field,
                                             const RenderedRelief& truth) {
  Image<float> angle;
  EXPECT_TRUE(AngularErrorDeg(field, truth.normal, &angle));
  const Image<float> albedo = AlbedoErrorMap(field, truth.albedo).value();
  double of_angle = 0.0;
  double of_albedo = 0.0;
  for (size_t p = 0; p < angle.pixels.size(); ++p) {
    of_angle += std::pow(static_cast<double>(angle.pixels[p] / field.uncertainty.pixels[p]), 2);
    of_albedo +=
        std::pow(static_cast<double>(albedo.pixels[p] / field.albedo_uncertainty.pixels[p]), 2);
  }
  const auto count = static_cast<double>(angle.pixels.size());
  return {std::sqrt(of_angle / count), std::sqrt(of_albedo / count)};
}

// Noise that hides much of the lobe: pixels that have it and pixels that do not are told apart by
// odds, and what is not sure is in the uncertainty.
TEST(Lobe, BesideMatteClothEveryPixelSaysHowSureItIs) {
  constexpr int kShare = 90;  // percent
  constexpr double kFewElectrons = 100000.0;
  const Rig rig = RingRig(kLobeSize);
  RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
  AddLobe(rig, {.model = LobeModel::kGgx, .alpha = 0.3, .strength = 1.0}, kShare, kFewElectrons,
          rendered);
  for (Image<float>& plane : rendered.albedo.planes) {
    for (float& rho : plane.pixels) {
      rho *= 0.03F;
    }
  }
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kFewElectrons, rig.lights.size()));
  ASSERT_TRUE(field.summary.lobe);
  EXPECT_NEAR(field.summary.lobe->share, 0.01 * kShare, 0.1);
  const auto [angle, albedo] = StandardisedErrors(field, rendered);
  EXPECT_LT(angle, 1.3);
  EXPECT_GT(angle, 0.15);
  EXPECT_LT(albedo, 1.3);
}

// Light from everywhere looks like gloss that is rougher and stronger than any.
TEST(Lobe, StrayLightIsNone) {
  const Rig rig = testing::TwoRings();
  // Both as shares of what a light gives that stands above.
  for (const auto& [stray, noise] : {std::pair{0.1, 0.01}, {0.2, 0.02}, {0.05, 0.01}}) {
    std::mt19937 random(9);
    std::normal_distribution<double> deviate;
    std::vector<LobeSamples> pixels;
    for (int p = 0; p < 400; ++p) {
      const Eigen::Vector3d n =
          Eigen::Vector3d(0.2 * deviate(random), 0.2 * deviate(random), 1.0).normalized();
      Eigen::MatrixX3d l(static_cast<Eigen::Index>(rig.lights.size()), 3);
      Eigen::MatrixX4d i(l.rows(), 4);
      for (Eigen::Index k = 0; k < l.rows(); ++k) {
        l.row(k) = rig.lights[static_cast<size_t>(k)].direction;
        i.row(k).setConstant(0.2 *
                             (std::max(0.0, l.row(k).dot(n)) + stray + noise * deviate(random)));
      }
      const Eigen::VectorXd weights =
          Eigen::VectorXd::Constant(l.rows(), 1.0 / (0.04 * noise * noise));
      pixels.emplace_back(l, i, weights, Eigen::Vector3d::UnitZ(), 3.9);
    }
    EXPECT_FALSE(SearchLobe(pixels, 2)) << stray << " " << noise;
  }
}

TEST(Lobe, TheLightsDoubtIsInItsUncertainty) {
  Rig rig = RingRig(kLobeSize);
  RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
  AddLobe(rig, kGloss, 100, kElectrons, rendered);
  for (Light& light : rig.lights) {
    light.irradiance_sd = 0.05;
  }
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kElectrons, rig.lights.size()));
  EXPECT_GT(field.summary.under_lobe.pixels, 3072 / 2);
  EXPECT_GT(field.summary.under_lobe.mean_uncertainty_deg, 1.0);
}

TEST(Lobe, LambertianScenesHaveNone) {
  const Rig rig = RingRig(kLobeSize);
  RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
  AddLobe(rig, kFuzz, 0, kElectrons, rendered);
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kElectrons, rig.lights.size()));
  EXPECT_FALSE(field.summary.lobe);
  EXPECT_EQ(field.summary.under_lobe.pixels, 0);
}

TEST(Lobe, IsNotBelievedWhereItLeavesAThirdUnexplained) {
  const Rig rig = RingRig(kLobeSize);
  RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
  testing::Spoil(rendered.stack, 3, 5);  // highlights and shadows
  AddLobe(rig, kFuzz, 100, kElectrons, rendered);
  const NormalField field =
      MustSolve(rendered.stack, rig, WithShotNoise(kElectrons, rig.lights.size()));
  EXPECT_EQ(field.summary.under_lobe.pixels, 0);
  EXPECT_GT(field.summary.robust.pixels, 2000);
}

TEST(Lobe, AnyNumberOfThreadsGivesTheSameBits) {
  const Rig rig = RingRig(kLobeSize);
  RenderedRelief rendered = Render(rig, kLobeSize, 20.0);
  AddLobe(rig, kFuzz, 97, kElectrons, rendered);
  const LadderOptions options = WithShotNoise(kElectrons, rig.lights.size());
  const NormalField one = MustSolve(rendered.stack, rig, options, 1);
  EXPECT_GT(one.summary.under_lobe.pixels, 0);
  const NormalField many = MustSolve(rendered.stack, rig, options, 7);
  EXPECT_TRUE(testing::SameBits(one, many));
  EXPECT_EQ(one.model.pixels, many.model.pixels);
}

}  // namespace
}  // namespace sateen::lobe_test
