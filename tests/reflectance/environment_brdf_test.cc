#include "reflectance/environment_brdf.h"

#include <gtest/gtest.h>

#include "reflectance/specular.h"
#include "tests/reflectance/furnace.h"

namespace sateen::environment_brdf_test {
namespace {

const Eigen::Vector3d kPlastic = Eigen::Vector3d::Constant(0.04);

// Fine quadrature over normals and over light directions agree on 0.972441 and 0.963262. The row
// prints 0.9725 and 0.9632, from a table of its own: each a little more than half a digit away.
TEST(EnvironmentBrdf, Row1_24_WhatTheSpecularLeavesToTheDiffuse) {
  const auto integral = [](double n_l) {
    const Eigen::Vector2d terms = IntegrateEnvironmentBrdf(n_l, 0.5);
    return 1.0 - 0.04 * terms[0] - terms[1];
  };
  EXPECT_NEAR(integral(1.0), 0.972441, 5e-6);
  EXPECT_NEAR(integral(0.5), 0.963262, 5e-6);
  const EnvironmentBrdf table;
  EXPECT_NEAR(table.DiffuseShare(1.0, kPlastic, 0.5)[0], 0.9725, 1e-4);
  EXPECT_NEAR(table.DiffuseShare(0.5, kPlastic, 0.5)[0], 0.9632, 1e-4);
}

// The first slice of the table of row 1-22, with its tolerance.
TEST(EnvironmentBrdf, Row1_22_ScaleAndBiasWithoutOcclusion) {
  const EnvironmentBrdf table;
  const Eigen::Vector2d rough = table.ScaleAndBias(0.5, 0.5);
  EXPECT_NEAR(rough[0], 0.6769, 0.002);
  EXPECT_NEAR(rough[1], 0.0097, 0.002);
  const Eigen::Vector2d smooth = table.ScaleAndBias(0.2, 0.25);
  EXPECT_NEAR(smooth[0], 0.7381, 0.002);
  EXPECT_NEAR(smooth[1], 0.0940, 0.002);
}

// The integral over normals against the plain one over light directions. The plain one is the
// coarser of the two where the lobe is narrow: it has 256 steps.
TEST(EnvironmentBrdf, IsTheDirectionalAlbedoOfGgx) {
  for (const double alpha : {0.2, 0.5, 1.0}) {
    for (const double n_v : {1.0, 0.5, 0.2}) {
      for (const double f0 : {0.0, 0.04, 1.0}) {
        const Ggx ggx({.f0 = Eigen::Vector3d::Constant(f0), .alpha = alpha});
        const Eigen::Vector2d terms = IntegrateEnvironmentBrdf(n_v, alpha);
        EXPECT_NEAR(f0 * terms[0] + terms[1], AlbedoOf(ggx, n_v, 256), 1.5e-3)
            << "alpha " << alpha << " n.v " << n_v << " f0 " << f0;
      }
    }
  }
}

// Interpolation: at points between the nodes of both axes.
TEST(EnvironmentBrdf, TableFollowsTheIntegral) {
  const EnvironmentBrdf table;
  for (const double alpha : {0.06, 0.13, 0.37, 0.71, 0.99}) {
    for (const double n_v : {0.999, 0.83, 0.41, 0.17, 0.03, 0.004}) {
      const Eigen::Vector2d exact = IntegrateEnvironmentBrdf(n_v, alpha);
      EXPECT_LT((table.ScaleAndBias(n_v, alpha) - exact).norm(), 4e-3)
          << "alpha " << alpha << " n.v " << n_v;
    }
  }
}

TEST(EnvironmentBrdf, MirrorReflectsSchlick) {
  for (const double n_v : {1.0, 0.5, 0.1}) {
    const Eigen::Vector2d terms = IntegrateEnvironmentBrdf(n_v, 0.0);
    const double schlick = std::pow(1.0 - n_v, 5.0);
    // The weights 2 s of the steps add up to 1 only to rounding.
    EXPECT_NEAR(terms[0], 1.0 - schlick, 1e-12);
    EXPECT_NEAR(terms[1], schlick, 1e-12);
  }
}

TEST(EnvironmentBrdf, ReflectsAndLeavesAllThereIs) {
  const EnvironmentBrdf table;
  const Eigen::Vector3d f0(0.9, 0.5, 0.1);
  for (const double cosine : {0.0, 0.3, 1.0}) {
    const Eigen::Vector3d reflectance = table.Reflectance(cosine, f0, 0.4);
    EXPECT_LT((reflectance + table.DiffuseShare(cosine, f0, 0.4) - kWhite).norm(), 1e-15);
    EXPECT_GT(reflectance[0], reflectance[1]);
    EXPECT_GT(reflectance[1], reflectance[2]);
  }
}

// A cosine a little out of range, as rounding makes them, is that of the nearest end.
TEST(EnvironmentBrdf, CosinesOutOfRangeAreClamped) {
  const EnvironmentBrdf table;
  EXPECT_EQ(table.ScaleAndBias(1.0 + 1e-9, 0.5), table.ScaleAndBias(1.0, 0.5));
  EXPECT_EQ(table.ScaleAndBias(-0.3, 0.5), table.ScaleAndBias(0.0, 0.5));
}

}  // namespace
}  // namespace sateen::environment_brdf_test
