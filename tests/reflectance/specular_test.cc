#include "reflectance/specular.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "reflectance/microfacet.h"

namespace sateen::specular_test {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();
const Eigen::Vector3d kMirror = Eigen::Vector3d::Ones();

Eigen::Vector3d ViewAt(double n_v) { return {std::sqrt(1.0 - n_v * n_v), 0.0, n_v}; }

// Integral of D(m) (n.m) over the hemisphere: the midpoint rule in cos^2, smooth for all of these.
template <typename D>
double ProjectedArea(const D& distribution) {
  constexpr int kSide = 100000;
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    sum += distribution(std::sqrt((i + 0.5) / kSide));
  }
  return kPi * sum / kSide;
}

TEST(Microfacet, Row0_01_GgxDistribution) {
  EXPECT_NEAR(GgxDistribution(0.9, 0.5), 0.516548, 5e-7);
  EXPECT_NEAR(GgxDistribution(1.0, 0.5), 1.27324, 5e-6);
  EXPECT_NEAR(ProjectedArea([](double x) { return GgxDistribution(x, 0.5); }), 1.0, 1e-6);
}

TEST(Microfacet, Row0_02_SmithMasking) {
  EXPECT_NEAR(GgxMasking(0.3, 0.5), 0.694870, 5e-7);
  // The lambda form: 1 / (1 + (sqrt(1 + alpha^2 tan^2) - 1) / 2).
  const double tan2 = (1.0 - 0.09) / 0.09;
  EXPECT_NEAR(GgxMasking(0.3, 0.5), 2.0 / (1.0 + std::sqrt(1.0 + 0.25 * tan2)), 1e-14);
  EXPECT_NEAR(GgxVisibility(0.7, 0.3, 0.5),
              GgxMasking(0.7, 0.5) * GgxMasking(0.3, 0.5) / (4.0 * 0.7 * 0.3), 1e-14);
}

TEST(Microfacet, Row0_03_FurnaceOfTheVisibilityForm) {
  const auto albedo = [](double alpha) {
    return DirectionalAlbedo(Ggx({.f0 = kMirror, .alpha = alpha}), kUp, kUp)[0];
  };
  EXPECT_NEAR(albedo(1.0), 0.3069, 5e-5);
  EXPECT_NEAR(albedo(0.5), 0.6878, 5e-5);
  EXPECT_NEAR(albedo(0.3), 0.8774, 5e-5);
}

TEST(Microfacet, Row0_04_NormalsTurnedAwayStayContinuous) {
  const Ggx ggx({.alpha = 0.5});
  const Eigen::Vector3d l = Eigen::Vector3d(-0.6, 0.0, 0.8);
  const double before = ggx.Evaluate(kUp, l, ViewAt(1e-6))[0];
  const double after = ggx.Evaluate(kUp, l, Eigen::Vector3d(1.0, 0.0, -1e-6).normalized())[0];
  EXPECT_GT(before, 0.01);
  EXPECT_NEAR(before, after, 1e-3 * before);
}

TEST(Microfacet, Row0_05_AnisotropicGgx) {
  EXPECT_NEAR(GgxDistribution({0.3, 0.2, std::sqrt(1.0 - 0.13)}, 0.6, 0.3), 0.722532, 5e-7);
  EXPECT_NEAR(GgxDistribution({0.3, 0.2, std::sqrt(1.0 - 0.13)}, 0.5, 0.5),
              GgxDistribution(std::sqrt(1.0 - 0.13), 0.5), 1e-13);
  constexpr int kSide = 2000;
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    const double cos2 = (i + 0.5) / kSide;
    for (int j = 0; j < kSide; ++j) {
      const double phi = 2.0 * kPi * (j + 0.5) / kSide;
      const double sine = std::sqrt(1.0 - cos2);
      sum +=
          GgxDistribution({sine * std::cos(phi), sine * std::sin(phi), std::sqrt(cos2)}, 0.6, 0.3);
    }
  }
  EXPECT_NEAR(kPi * sum / (kSide * kSide), 1.0, 1e-6);
}

TEST(Microfacet, Row0_09_Velvet) {
  EXPECT_NEAR(VelvetDistribution(1.0, 0.5), 0.159155, 5e-7);
  EXPECT_NEAR(VelvetDistribution(0.5, 0.5), 0.457486, 5e-7);
  for (const double alpha : {0.2, 0.5, 1.0}) {
    EXPECT_NEAR(ProjectedArea([&](double x) { return VelvetDistribution(x, alpha); }), 1.0, 1e-6);
  }
}

TEST(Microfacet, Row0_10_Cloth) {
  const Cloth cloth({.f0 = kMirror, .alpha = 0.6});
  const auto albedo = [&](double n_v) {
    return DirectionalAlbedo(cloth, kUp, ViewAt(n_v), 1024)[0];
  };
  EXPECT_NEAR(albedo(1.0), 0.107, 5e-4);
  EXPECT_NEAR(albedo(0.4), 0.312, 5e-4);
  EXPECT_NEAR(albedo(0.05), 0.630, 1.5e-3);  // quadrature: a peak at grazing angles
}

TEST(Microfacet, Row0_35_Beckmann) {
  EXPECT_NEAR(BeckmannDistribution(0.9, 0.5), 0.759371, 5e-7);
  EXPECT_NEAR(BeckmannMasking(0.3, 0.5), 0.894296, 5e-7);  // exact 0.896783
  EXPECT_NEAR(ProjectedArea([](double x) { return BeckmannDistribution(x, 0.5); }), 1.0, 1e-6);
}

TEST(Microfacet, Row0_36_Schlick) {
  EXPECT_NEAR(SchlickFresnel(Eigen::Vector3d::Constant(0.04), 0.5)[1], 0.04 + 0.96 / 32.0, 1e-15);
}

TEST(Specular, IsReciprocalAndColouredByItsFresnel) {
  const Eigen::Vector3d l = Eigen::Vector3d(0.5, 0.3, 0.6).normalized();
  const Eigen::Vector3d v = Eigen::Vector3d(-0.2, 0.7, 0.4).normalized();
  const Eigen::Vector3d f0(0.9, 0.5, 0.1);
  const Ggx ggx({.f0 = f0, .alpha = 0.4});
  const GgxAnisotropic anisotropic({.f0 = f0, .alpha = 0.4, .anisotropy = 0.5});
  const Beckmann beckmann({.f0 = f0, .alpha = 0.4});
  const Cloth cloth({.f0 = f0, .alpha = 0.4});
  for (const Brdf* brdf : {static_cast<const Brdf*>(&ggx), static_cast<const Brdf*>(&anisotropic),
                           static_cast<const Brdf*>(&beckmann), static_cast<const Brdf*>(&cloth)}) {
    EXPECT_LT((brdf->Evaluate(kUp, l, v) - brdf->Evaluate(kUp, v, l)).norm(), 1e-14);
    EXPECT_GT(brdf->Evaluate(kUp, l, v)[0], brdf->Evaluate(kUp, l, v)[2]);
    EXPECT_EQ(brdf->Evaluate(kUp, -l, v).norm(), 0.0);
  }
}

TEST(Specular, NoneGivesBackMoreThanArrives) {
  const Ggx ggx({.f0 = kMirror, .alpha = 0.4});
  const GgxAnisotropic anisotropic({.f0 = kMirror, .alpha = 0.6, .anisotropy = 0.5});
  const Beckmann beckmann({.f0 = kMirror, .alpha = 0.4});
  const Cloth cloth({.f0 = kMirror, .alpha = 0.4});
  for (const Brdf* brdf : {static_cast<const Brdf*>(&ggx), static_cast<const Brdf*>(&anisotropic),
                           static_cast<const Brdf*>(&beckmann), static_cast<const Brdf*>(&cloth)}) {
    for (const double n_v : {1.0, 0.7, 0.4, 0.2}) {
      const double share = DirectionalAlbedo(*brdf, kUp, ViewAt(n_v))[0];
      EXPECT_LT(share, 1.0) << n_v;
      EXPECT_GT(share, 0.05) << n_v;
    }
  }
}

TEST(Specular, AnisotropyFollowsTheTangent) {
  const GgxAnisotropic along_x({.alpha = 0.6, .anisotropy = 0.8});
  const GgxAnisotropic along_y(
      {.alpha = 0.6, .anisotropy = 0.8, .tangent = Eigen::Vector3d(0, 2, 0)});
  const Eigen::Vector3d tilted_x = Eigen::Vector3d(0.5, 0, 1).normalized();
  const Eigen::Vector3d tilted_y = Eigen::Vector3d(0, 0.5, 1).normalized();
  // Rough along the tangent: the lobe is wide in that direction.
  EXPECT_GT(along_x.Evaluate(kUp, tilted_x, kUp)[0], 3.0 * along_x.Evaluate(kUp, tilted_y, kUp)[0]);
  EXPECT_NEAR(along_x.Evaluate(kUp, tilted_x, kUp)[0], along_y.Evaluate(kUp, tilted_y, kUp)[0],
              1e-12);
}

TEST(Specular, ErrorsNameTheFieldAndItsRange) {
  const auto message = [](const Status& status) {
    return status ? std::string("valid") : status.error().message;
  };
  EXPECT_THAT(message(Ggx({.alpha = -1}).Validate()), HasSubstr("alpha = -1; need 0.001 to 1"));
  EXPECT_THAT(message(Cloth({.f0 = {0, 2, 0}}).Validate()), HasSubstr("f0 = 2; need 0 to 1"));
  EXPECT_THAT(message(GgxAnisotropic({.anisotropy = 2}).Validate()), HasSubstr("anisotropy = 2"));
  EXPECT_THAT(message(GgxAnisotropic({.tangent = {0, 0, 0}}).Validate()), HasSubstr("tangent"));
}

}  // namespace
}  // namespace sateen::specular_test
