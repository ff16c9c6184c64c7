#include "reflectance/diffuse.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "reflectance/environment_brdf.h"
#include "tests/reflectance/furnace.h"

namespace sateen::diffuse_test {
namespace {

using ::testing::HasSubstr;

// The midpoint rule is off by this where a model falls to 0 at grazing angles.
constexpr double kFurnaceNoise = 3e-5;
constexpr double kViewCosines[] = {1.0, 0.8, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01};

TEST(Diffuse, LambertReflectsItsAlbedo) {
  const Lambert lambert({.albedo = {0.8, 0.5, 0.2}});
  for (const double n_v : kViewCosines) {
    EXPECT_NEAR(AlbedoOf(lambert, n_v, 16), 0.8, 1e-12);
  }
  const Eigen::Vector3d f = lambert.Evaluate(kNormal, DirectionAt(0.5), kNormal);
  EXPECT_LT((f - Eigen::Vector3d(0.8, 0.5, 0.2) / std::numbers::pi).norm(), 1e-15);
}

TEST(Diffuse, Row0_06_FresnelBalancedAsPublished) {
  const FresnelBalancedLambert published({.albedo = kWhite, .energy_safe = false});
  EXPECT_NEAR(AlbedoOf(published, 1.0), 0.9599, 5e-5);
  EXPECT_NEAR(AlbedoOf(published, 0.2), 0.9453, 5e-5);
  // With the Ggx on top.
  const auto total = [&](double n_v, double alpha) {
    const Eigen::Vector2d ggx = IntegrateEnvironmentBrdf(n_v, alpha);
    return AlbedoOf(published, n_v) + 0.04 * ggx[0] + ggx[1];
  };
  EXPECT_NEAR(total(0.2, 0.2), 1.0946, 5e-5);
  EXPECT_NEAR(total(0.02, 0.2), 1.154, 5e-4);
  EXPECT_NEAR(total(0.02, 0.5), 1.024, 5e-4);
  EXPECT_NEAR(total(0.02, 1.0), 0.976, 5e-4);
}

TEST(Diffuse, Row0_06_FresnelBalancedConservesEnergyWithItsSpecular) {
  for (const double alpha : {0.001, 0.1, 0.2, 0.5, 1.0}) {
    for (const double f0 : {0.0, 0.04, 0.5, 0.9}) {
      const FresnelBalancedLambert safe(
          {.albedo = kWhite, .f0 = Eigen::Vector3d::Constant(f0), .alpha = alpha});
      for (const double n_v : kViewCosines) {
        const Eigen::Vector2d ggx = IntegrateEnvironmentBrdf(n_v, alpha);
        EXPECT_LE(AlbedoOf(safe, n_v, 128) + f0 * ggx[0] + ggx[1], 1.0)
            << "alpha " << alpha << " f0 " << f0 << " n.v " << n_v;
      }
    }
  }
}

TEST(Diffuse, SafeFresnelBalancedIsThePublishedOneWhereThereIsRoom) {
  const FresnelBalancedLambert safe({.albedo = kWhite, .alpha = 0.5});
  const FresnelBalancedLambert published({.albedo = kWhite, .energy_safe = false});
  const Eigen::Vector3d l = DirectionAt(0.6);
  EXPECT_EQ(safe.Evaluate(kNormal, l, kNormal), published.Evaluate(kNormal, l, kNormal));
  const Eigen::Vector3d grazing = DirectionAt(0.05);
  EXPECT_LT(safe.Evaluate(kNormal, grazing, kNormal)[0],
            0.99 * published.Evaluate(kNormal, grazing, kNormal)[0]);
}

// A metal of f0 = 1 leaves no room, and nothing to divide by.
TEST(Diffuse, FresnelBalancedUnderAFullMirrorIsBlack) {
  const FresnelBalancedLambert under({.albedo = kWhite, .f0 = {1.0, 0.5, 0.04}, .alpha = 0.001});
  for (const double n_l : kViewCosines) {
    const Eigen::Vector3d f = under.Evaluate(kNormal, DirectionAt(n_l), DirectionAt(0.4));
    EXPECT_EQ(f[0], 0.0);
    EXPECT_GT(f[2], f[1]);
  }
}

TEST(Diffuse, Row1_25_Shirley) {
  const ShirleyDiffuse shirley({.albedo = kWhite});
  EXPECT_NEAR(AlbedoOf(shirley, 1.0), 0.9600, kFurnaceNoise);
  EXPECT_NEAR(AlbedoOf(shirley, 0.5), 0.9300, kFurnaceNoise);
  // The share of uniform light that is given back: f depends on n.l and n.v alone.
  constexpr int kSteps = 200;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double n_l = (i + 0.5) / kSteps;
    for (int j = 0; j < kSteps; ++j) {
      const double n_v = (j + 0.5) / kSteps;
      sum += shirley.Evaluate(kNormal, DirectionAt(n_l), DirectionAt(n_v))[0] * n_l * n_v;
    }
  }
  EXPECT_NEAR(4.0 * std::numbers::pi * sum / (kSteps * kSteps), 0.9143, 5e-5);
}

TEST(Diffuse, Row1_25_ShirleyWithAMirrorGivesBackAllLight) {
  const ShirleyDiffuse shirley({.albedo = kWhite});
  for (const double n_v : kViewCosines) {
    const double mirror = 0.04 + 0.96 * std::pow(1.0 - n_v, 5.0);
    EXPECT_NEAR(AlbedoOf(shirley, n_v) + mirror, 1.0, kFurnaceNoise);
  }
}

TEST(Diffuse, Row1_30_HandFitAsPublished) {
  const auto at = [](double gloss) {
    return MultiScatterDiffuse({.albedo = kWhite, .gloss = gloss, .energy_safe = false});
  };
  const auto retro = [&](double gloss) {
    const Eigen::Vector3d v = DirectionAt(0.5);
    return std::numbers::pi * at(gloss).Evaluate(kNormal, v, v)[0];
  };
  EXPECT_NEAR(retro(0.0), 1.31240, 5e-6);
  EXPECT_NEAR(retro(0.5), 0.974116, 5e-7);
  EXPECT_NEAR(retro(1.0), 0.953674, 5e-7);
  EXPECT_NEAR(AlbedoOf(at(0.0), 1.0), 0.9732, 5e-5);
  EXPECT_NEAR(AlbedoOf(at(0.5), 1.0), 0.9429, 5e-5);
  EXPECT_NEAR(AlbedoOf(at(1.0), 1.0), 0.9643, 5e-5);
  // The reason for the safe form: more light than arrives, from the rough fit at grazing angles.
  EXPECT_NEAR(AlbedoOf(at(0.0), 0.1), 1.045, 5e-4);
  EXPECT_NEAR(AlbedoOf(at(0.0), 0.02), 1.127, 1e-3);  // quadrature: a peak at grazing angles
}

TEST(Diffuse, Row1_30_HandFitConservesEnergy) {
  for (const double gloss : {0.0, 0.1, 0.25, 0.5, 0.75, 1.0}) {
    const MultiScatterDiffuse safe({.albedo = kWhite, .gloss = gloss});
    for (const double n_v : {1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.001}) {
      EXPECT_LE(AlbedoOf(safe, n_v), 1.0) << "gloss " << gloss << " n.v " << n_v;
    }
  }
}

TEST(Diffuse, SafeHandFitIsThePublishedOneWhereThereIsRoom) {
  for (const double gloss : {0.5, 1.0}) {
    const MultiScatterDiffuse safe({.gloss = gloss});
    const MultiScatterDiffuse published({.gloss = gloss, .energy_safe = false});
    const Eigen::Vector3d l = DirectionAt(0.1);
    EXPECT_EQ(safe.Evaluate(kNormal, l, l), published.Evaluate(kNormal, l, l));
  }
  // At gloss 0 it loses light at grazing angles and keeps it elsewhere.
  EXPECT_NEAR(AlbedoOf(MultiScatterDiffuse({.albedo = kWhite}), 1.0), 0.9732, 2e-3);
}

TEST(Diffuse, IsReciprocalAndDarkFromBelow) {
  const Eigen::Vector3d albedo(0.9, 0.5, 0.1);
  const Lambert lambert({.albedo = albedo});
  const FresnelBalancedLambert balanced({.albedo = albedo, .energy_safe = false});
  const FresnelBalancedLambert balanced_safe({.albedo = albedo, .alpha = 0.2});
  const ShirleyDiffuse shirley({.albedo = albedo});
  const MultiScatterDiffuse scatter({.albedo = albedo, .energy_safe = false});
  const MultiScatterDiffuse scatter_safe({.albedo = albedo, .gloss = 0.1});
  const Eigen::Vector3d l = DirectionAt(0.6);
  for (const Brdf* brdf :
       {static_cast<const Brdf*>(&lambert), static_cast<const Brdf*>(&balanced),
        static_cast<const Brdf*>(&balanced_safe), static_cast<const Brdf*>(&shirley),
        static_cast<const Brdf*>(&scatter), static_cast<const Brdf*>(&scatter_safe)}) {
    EXPECT_LT(ReciprocityError(*brdf), 1e-14);
    EXPECT_EQ(brdf->Evaluate(kNormal, -l, kNormal).norm(), 0.0);
    // Grey Fresnel: the colour is that of the albedo.
    const Eigen::Vector3d f = brdf->Evaluate(kNormal, l, kNormal);
    EXPECT_LT((f / f[0] - albedo / albedo[0]).norm(), 1e-14);
  }
}

TEST(Diffuse, ErrorsNameTheFieldAndItsRange) {
  EXPECT_THAT(MessageOf(Lambert({.albedo = {0, 0, 1.5}}).Validate()),
              HasSubstr("albedo = 1.5; need 0 to 1"));
  EXPECT_THAT(MessageOf(FresnelBalancedLambert({.albedo = {-1, 0, 0}}).Validate()),
              HasSubstr("albedo = -1"));
  EXPECT_THAT(MessageOf(FresnelBalancedLambert({.f0 = {0, 2, 0}}).Validate()),
              HasSubstr("f0 = 2; need 0 to 1"));
  EXPECT_THAT(MessageOf(FresnelBalancedLambert({.alpha = 0}).Validate()),
              HasSubstr("alpha = 0; need 0.001 to 1"));
  EXPECT_THAT(MessageOf(ShirleyDiffuse({.albedo = {2, 0, 0}}).Validate()), HasSubstr("albedo = 2"));
  EXPECT_THAT(MessageOf(ShirleyDiffuse({.f0 = {-1, 0, 0}}).Validate()), HasSubstr("f0 = -1"));
  EXPECT_THAT(MessageOf(MultiScatterDiffuse({.albedo = {0, 3, 0}}).Validate()),
              HasSubstr("albedo = 3"));
  EXPECT_THAT(MessageOf(MultiScatterDiffuse({.gloss = std::nan("")}).Validate()),
              HasSubstr("gloss = nan; need 0 to 1"));
  EXPECT_TRUE(MultiScatterDiffuse({}).Validate());
}

}  // namespace
}  // namespace sateen::diffuse_test
