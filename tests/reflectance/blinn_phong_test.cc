#include "reflectance/blinn_phong.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reflectance/microfacet.h"
#include "tests/reflectance/furnace.h"

namespace sateen::blinn_phong_test {
namespace {

using ::testing::HasSubstr;

constexpr double kPowers[] = {2.0, 10.0, 100.0, 1000.0};

// Integral of g(cos) over the hemisphere about n, by the midpoint rule in the angle.
template <typename G>
double HemisphereIntegral(const G& g) {
  constexpr int kSteps = 20000;
  constexpr double kStepRad = 0.5 * std::numbers::pi / kSteps;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double polar_rad = (i + 0.5) * kStepRad;
    sum += g(std::cos(polar_rad)) * std::sin(polar_rad);
  }
  return 2.0 * std::numbers::pi * sum * kStepRad;
}

// n.h of a light at n.l, seen along n: half the angle.
double HalfCosine(double n_l) { return std::sqrt(0.5 * (1.0 + n_l)); }

// Largest difference of two functions of x in [0, 1].
template <typename F, typename G>
double WorstDifference(const F& f, const G& g) {
  constexpr int kSteps = 10000;
  double worst = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = static_cast<double>(i) / kSteps;
    worst = std::max(worst, std::abs(f(x) - g(x)));
  }
  return worst;
}

TEST(BlinnPhong, Row2_01_NormalisationFactors) {
  for (const double n : kPowers) {
    // Seen along n, r.v is n.l.
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return PhongLobeFactor(n) * std::pow(x, n); }),
                1.0, 5e-7);
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return PhongFactor(n) * std::pow(x, n) * x; }),
                1.0, 5e-7);
    EXPECT_NEAR(HemisphereIntegral(
                    [&](double x) { return BlinnPhongLobeFactor(n) * std::pow(HalfCosine(x), n); }),
                1.0, 5e-7);
    EXPECT_NEAR(HemisphereIntegral(
                    [&](double x) { return BlinnPhongFactor(n) * std::pow(HalfCosine(x), n) * x; }),
                1.0, 5e-7);
  }
}

TEST(BlinnPhong, Row2_01_CheapFactorGivesBackTooMuch) {
  const auto energy = [](double n) {
    return HemisphereIntegral(
        [&](double x) { return CheapBlinnPhongFactor(n) * std::pow(HalfCosine(x), n) * x; });
  };
  EXPECT_NEAR(energy(2.0), 1.0417, 5e-5);
  EXPECT_NEAR(energy(10.0), 1.0748, 5e-5);
  EXPECT_NEAR(energy(100.0), 1.0181, 5e-5);
}

TEST(BlinnPhong, Row2_02_DistributionsHaveProjectedAreaOne) {
  for (const double n : kPowers) {
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return BlinnDistribution(x, n) * x; }), 1.0,
                5e-7);
  }
  for (const double alpha : {0.1, 0.5, 1.0}) {
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return GgxDistribution(x, alpha) * x; }), 1.0,
                1e-6);
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return BeckmannDistribution(x, alpha) * x; }),
                1.0, 1e-6);
    EXPECT_NEAR(HemisphereIntegral([&](double x) { return VelvetDistribution(x, alpha) * x; }), 1.0,
                1e-6);
  }
}

// Implicit G loses light where the lobe is wide.
TEST(BlinnPhong, Row2_02_FurnaceOfTheMicrofacetForm) {
  const auto albedo = [](double n) {
    return AlbedoOf(BlinnPhong({.f0 = kWhite, .power = n}), 1.0);
  };
  EXPECT_NEAR(albedo(2.0), 0.4167, 5e-5);
  EXPECT_NEAR(albedo(10.0), 0.7165, 5e-5);
  EXPECT_NEAR(albedo(100.0), 0.9615, 5e-5);
  for (const double n_v : {0.7, 0.3, 0.05}) {
    EXPECT_LE(AlbedoOf(BlinnPhong({.f0 = kWhite, .power = 10.0}), n_v), 1.0) << "n.v " << n_v;
  }
}

TEST(BlinnPhong, IsItsMicrofacetParts) {
  const Eigen::Vector3d f0(0.9, 0.5, 0.1);
  const Eigen::Vector3d l = Eigen::Vector3d(0.5, 0.3, 0.6).normalized();
  const Eigen::Vector3d v = Eigen::Vector3d(-0.2, 0.7, 0.4).normalized();
  const Eigen::Vector3d h = (l + v).normalized();
  const double geometry = l.z() * v.z();
  const Eigen::Vector3d expected = BlinnDistribution(h.z(), 30.0) * geometry *
                                   SchlickFresnel(f0, l.dot(h)) / (4.0 * l.z() * v.z());
  const BlinnPhong blinn({.f0 = f0, .power = 30.0});
  EXPECT_LT((blinn.Evaluate(kNormal, l, v) - expected).norm(), 1e-14);
  EXPECT_LT(ReciprocityError(blinn), 1e-14);
  EXPECT_EQ(blinn.Evaluate(kNormal, -l, v).norm(), 0.0);
}

TEST(BlinnPhong, Row2_03_DirectLightingModel) {
  const DirectLighting white(
      {.diffuse = {.albedo = kWhite}, .specular = {.f0 = Eigen::Vector3d::Zero()}});
  EXPECT_LT((PunctualRadiance(white, kNormal, kNormal, DirectionAt(0.5), kWhite) -
             kWhite * (1.0 + std::pow(1.0 - HalfCosine(0.5), 5.0) * 66.0 / 8.0 *
                                 std::pow(HalfCosine(0.5), 64.0)))
                .norm(),
            1e-12);
  EXPECT_NEAR(PunctualRadiance(white, kNormal, kNormal, kNormal, kWhite)[0], 1.0, 1e-15);
  // (c_diff + (n + 2) / 8 (n.h)^n F) c_light (n.l) at l = 60 degrees, v = n.
  const DirectLighting red(
      {.diffuse = {.albedo = {0.6, 0.2, 0.1}}, .specular = {.f0 = {0.3, 0.2, 0.1}, .power = 10.0}});
  const double n_h = std::cos(std::numbers::pi / 6.0);
  const double fresnel = 0.3 + 0.7 * std::pow(1.0 - n_h, 5.0);
  EXPECT_NEAR(PunctualRadiance(red, kNormal, DirectionAt(0.5), kNormal, {2.0, 1.0, 1.0})[0],
              (0.6 + 12.0 / 8.0 * std::pow(n_h, 10.0) * fresnel) * 2.0 * 0.5, 1e-14);
  EXPECT_LT(ReciprocityError(red), 1e-14);
}

TEST(BlinnPhong, Row2_04_PunctualLight) {
  const Lambert grey({.albedo = Eigen::Vector3d::Constant(0.25)});
  const Eigen::Vector3d light(1.0, 2.0, 3.0);
  for (const double n_l : {1.0, 0.5, 0.1}) {
    const Eigen::Vector3d seen =
        PunctualRadiance(grey, kNormal, DirectionAt(n_l), DirectionAt(0.3), light);
    EXPECT_LT((seen - 0.25 * n_l * light).norm(), 1e-15);
  }
  EXPECT_EQ(PunctualRadiance(grey, kNormal, -kNormal, kNormal, light).norm(), 0.0);
}

TEST(BlinnPhong, Row2_06_GreyAndColouredAgreeWhereEqual) {
  const BlinnPhong grey({.f0 = Eigen::Vector3d::Constant(0.5), .power = 20.0});
  const BlinnPhong coloured({.f0 = {0.9, 0.5, 0.1}, .power = 20.0});
  const Eigen::Vector3d f =
      grey.Evaluate(kNormal, DirectionAt(0.8), Eigen::Vector3d(-0.6, 0.0, 0.8));
  const Eigen::Vector3d g =
      coloured.Evaluate(kNormal, DirectionAt(0.8), Eigen::Vector3d(-0.6, 0.0, 0.8));
  EXPECT_EQ(f[0], f[1]);
  EXPECT_EQ(f[1], f[2]);
  EXPECT_EQ(f[1], g[1]);
  EXPECT_GT(g[0], f[0]);
  EXPECT_LT(g[2], f[2]);
}

TEST(BlinnPhong, Row2_07_FresnelGaussians) {
  const auto schlick = [](double x) { return std::pow(1.0 - x, 5.0); };
  EXPECT_NEAR(WorstDifference(SchlickWeightGaussian, schlick), 0.0417, 5e-5);
  EXPECT_NEAR(std::abs(SchlickWeightGaussian(0.102) - schlick(0.102)), 0.0417, 5e-5);
  EXPECT_NEAR(WorstDifference(SchlickWeightGaussianQuadratic, schlick), 0.0038, 5e-5);
}

TEST(BlinnPhong, Row2_07_LobeGaussiansSuitTheirPowers) {
  const auto worst = [](double n, const auto& gaussian) {
    return WorstDifference([n](double x) { return std::pow(x, n); },
                           [&](double x) { return gaussian(x, n); });
  };
  EXPECT_LT(worst(1000.0, BlinnLobeGaussian), 1e-3);
  EXPECT_LT(worst(1000.0, BlinnLobeGaussianLowPower), 1e-3);
  for (const double n : {2.0, 4.0, 8.0}) {
    EXPECT_LT(worst(n, BlinnLobeGaussianLowPower), worst(n, BlinnLobeGaussian)) << "n " << n;
  }
  EXPECT_EQ(BlinnLobeGaussian(1.0, 50.0), 1.0);
  EXPECT_NEAR(BlinnLobeGaussian(0.9, 10.0), std::exp(-1.0), 1e-14);
  EXPECT_NEAR(BlinnLobeGaussianLowPower(0.9, 9.0), std::exp(-1.0), 1e-14);
}

TEST(BlinnPhong, ErrorsNameTheFieldAndItsRange) {
  EXPECT_THAT(MessageOf(BlinnPhong({.power = -1}).Validate()),
              HasSubstr("power = -1; need 0 to 1e+06"));
  EXPECT_THAT(MessageOf(BlinnPhong({.f0 = {0, 0, 7}}).Validate()),
              HasSubstr("f0 = 7; need 0 to 1"));
  EXPECT_THAT(MessageOf(DirectLighting({.diffuse = {.albedo = {2, 0, 0}}}).Validate()),
              HasSubstr("albedo = 2; need 0 to 1"));
  EXPECT_THAT(MessageOf(DirectLighting({.specular = {.power = 1e9}}).Validate()),
              HasSubstr("power = 1e+09"));
  EXPECT_TRUE(DirectLighting({}).Validate());
}

}  // namespace
}  // namespace sateen::blinn_phong_test
