#include "simulation/surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "core/angle.h"
#include "simulation/random.h"
#include "simulation/trace.h"
#include "simulation/weave.h"

namespace sateen::surface_test {
namespace {

using ::testing::HasSubstr;

struct NamedSurface {
  std::string name;
  SurfacePtr surface;
};

SurfacePtr Made(Result<SurfacePtr> surface) {
  EXPECT_TRUE(surface) << surface.error().message;
  return std::move(*surface);
}

Image<float> Bumps() {
  Image<float> height(9, 7);
  for (size_t i = 0; i < height.pixels.size(); ++i) {
    height.pixels[i] = static_cast<float>(UniformDeviate(3, i));
  }
  return height;
}

// As steep between its samples as a cubic can be.
Image<float> Zigzag() {
  Image<float> height(4, 4);
  height.pixels = {0, 1, 0, 1, 1, 0, 1, 0, 0, -1, 0, 1, -1, 0, -1, 0};
  return height;
}

std::vector<NamedSurface> AllSurfaces() {
  std::vector<NamedSurface> all;
  all.push_back({"plane", Made(MakePlane(0.3, 1.0, -0.7))});
  all.push_back({"sphere", Made(MakeSphereCap(4.0, 1.2))});
  all.push_back({"groove", Made(MakeGroove(2.0, 1.0))});
  all.push_back({"steps", Made(MakeSteps(3, 2.0, 0.5, 0.25))});
  all.push_back({"waves", Made(MakeWaves(2.0, 0.6))});
  all.push_back({"height map", Made(MakeHeightMap(Bumps(), 1.0))});
  all.push_back({"zigzag", Made(MakeHeightMap(Zigzag(), 1.0))});
  for (const auto pattern : {WeavePattern::kPlain, WeavePattern::kTwill, WeavePattern::kSatin,
                             WeavePattern::kRib, WeavePattern::kKnit}) {
    all.push_back({"weave " + std::to_string(static_cast<int>(pattern)),
                   Made(MakeWeave({.pattern = pattern}))});
  }
  return all;
}

TEST(Surface, SlopeIsTheDerivativeOfHeightAndWithinItsBound) {
  constexpr double kStep = 1e-6;
  for (const auto& [name, surface] : AllSurfaces()) {
    int smooth = 0;
    for (uint64_t i = 0; i < 2000; ++i) {
      const double x = 8.0 * UniformDeviate(1, i) - 4.0;
      const double y = 8.0 * UniformDeviate(2, i) - 4.0;
      const SurfacePoint p = surface->At(x, y);
      EXPECT_LE(p.slope.norm(), surface->MaxSlope() * (1 + 1e-12)) << name;
      EXPECT_GE(p.height_mm, surface->LowestMm() - 1e-12) << name;
      EXPECT_LE(p.height_mm, surface->HighestMm() + 1e-12) << name;
      const auto height = [&](double dx, double dy) {
        return surface->At(x + dx, y + dy).height_mm;
      };
      const Eigen::Vector2d forward((height(kStep, 0) - height(0, 0)) / kStep,
                                    (height(0, kStep) - height(0, 0)) / kStep);
      const Eigen::Vector2d backward((height(0, 0) - height(-kStep, 0)) / kStep,
                                     (height(0, 0) - height(0, -kStep)) / kStep);
      if ((forward - backward).norm() < 1e-3) {  // no crease between
        ++smooth;
        EXPECT_LT((0.5 * (forward + backward) - p.slope).norm(), 1e-4)
            << name << ' ' << x << ' ' << y;
      }
    }
    EXPECT_GT(smooth, 1800) << name;
  }
}

TEST(Surface, NormalIsUnitAndPerpendicularToTheSlope) {
  const SurfacePoint p{.slope = {0.5, -0.25}};
  EXPECT_NEAR(p.Normal().norm(), 1.0, 1e-15);
  EXPECT_NEAR(p.Normal().dot(Eigen::Vector3d(1, 0, 0.5)), 0.0, 1e-15);
  EXPECT_NEAR(p.Normal().dot(Eigen::Vector3d(0, 1, -0.25)), 0.0, 1e-15);
}

TEST(Surface, KnownHeights) {
  EXPECT_NEAR(Made(MakePlane(std::numbers::pi / 4, 0.0))->At(2, 5).height_mm, 2.0, 1e-12);
  EXPECT_NEAR(Made(MakeSphereCap(4.0, std::acos(0.5)))->At(0, 0).height_mm, 2.0, 1e-12);
  EXPECT_EQ(Made(MakeSphereCap(4.0, std::acos(0.5)))->At(3.5, 0).height_mm, 0.0);
  EXPECT_NEAR(Made(MakeGroove(2.0, std::numbers::pi / 2))->At(-0.5, 9).height_mm, -1.5, 1e-12);
  const SurfacePtr steps = Made(MakeSteps(2, 2.0, 0.5, 0.25));
  EXPECT_EQ(steps->At(-1.01, 0).height_mm, 0.0);
  EXPECT_EQ(steps->At(0.0, 0).height_mm, 0.5);
  EXPECT_EQ(steps->At(3.0, 0).height_mm, 1.0);
  const SurfacePtr map = Made(MakeHeightMap(Bumps(), 1.0));
  EXPECT_NEAR(map->At(-4, 3).height_mm, static_cast<double>(Bumps().At(0, 0)), 1e-6);
  EXPECT_NEAR(map->At(0, 0).height_mm, static_cast<double>(Bumps().At(4, 3)), 1e-6);
}

TEST(Weave, FloatsAreAsLongAsThePatternSays) {
  // Along the middle of a warp yarn of 4 crossings of a 2/2 twill, two are on top; of a satin 4 of
  // 5.
  const auto warps_on_top = [](WeavePattern pattern, int repeat) {
    const SurfacePtr surface = Made(MakeWeave({.pattern = pattern}));
    int on_top = 0;
    for (int j = 0; j < repeat; ++j) {
      on_top += surface->At(0.5, j + 0.5).part == 0 ? 1 : 0;
    }
    return on_top;
  };
  EXPECT_EQ(warps_on_top(WeavePattern::kPlain, 4), 2);
  EXPECT_EQ(warps_on_top(WeavePattern::kTwill, 4), 2);
  EXPECT_EQ(warps_on_top(WeavePattern::kSatin, 5), 4);
  const SurfacePtr twill = Made(MakeWeave({.pattern = WeavePattern::kTwill}));
  for (int j = 0; j < 8; ++j) {  // the diagonal goes up to the right
    EXPECT_EQ(twill->At(0.5, j + 0.5).part, twill->At(1.5, j + 1.5).part);
  }
  const SurfacePtr satin = Made(MakeWeave({.pattern = WeavePattern::kSatin}));
  for (int j = 0; j < 10; ++j) {  // where the weft is on top once, no neighbour has it there
    if (satin->At(0.5, j + 0.5).part != 0) {
      for (const double beside : {-1.0, 0.0, 1.0}) {
        EXPECT_EQ(satin->At(1.5, j + beside + 0.5).part, 0);
      }
    }
  }
}

TEST(Trace, HitsEverySurfaceWhereItIs) {
  for (const auto& [name, surface] : AllSurfaces()) {
    for (uint64_t i = 0; i < 300; ++i) {
      const Eigen::Vector3d direction =
          Eigen::Vector3d(0.4 * UniformDeviate(4, i) - 0.2, 0.4 * UniformDeviate(5, i) - 0.2, -1)
              .normalized();
      const Ray ray{{8.0 * UniformDeviate(6, i) - 4.0, 8.0 * UniformDeviate(7, i) - 4.0, 50.0},
                    direction};
      const std::optional<double> t = FirstHit(*surface, ray);
      ASSERT_TRUE(t) << name;
      const Eigen::Vector3d hit = ray.At(*t);
      EXPECT_NEAR(hit.z(), surface->At(hit.x(), hit.y()).height_mm, 1e-8) << name;
      // Nothing above it on the way.
      for (int step = 0; step < 200; ++step) {
        const Eigen::Vector3d before = ray.At(*t - 0.01 * (step + 1));
        EXPECT_GT(before.z(), surface->At(before.x(), before.y()).height_mm) << name;
      }
    }
  }
}

// Light from the left at elevation a over a V-groove of half width w: the edge of the left wall
// throws its shadow on the right wall, z = x cot(b) - depth, where the ray from (-w, 0) meets it.
TEST(Trace, ShadowEdgeInAGrooveIsWhereGeometryPutsIt) {
  const double depth = 2.0;
  const double opening = 60.0 * kRadPerDeg;
  const double steepness = 1.0 / std::tan(opening / 2.0);
  const double half_width = depth / steepness;
  const SurfacePtr groove = Made(MakeGroove(depth, opening));
  for (const double elevation_deg : {10.0, 20.0, 35.0, 50.0, 55.0}) {
    const double a = elevation_deg * kRadPerDeg;
    const Eigen::Vector3d to_light(-std::cos(a), 0.0, std::sin(a));
    const double edge = (depth - half_width * std::tan(a)) / (steepness + std::tan(a));
    double dark = 0.0;
    double lit = half_width;
    if (edge < 0.0) {
      dark = -half_width * 0.999;
    }
    for (int i = 0; i < 60; ++i) {
      const double x = 0.5 * (dark + lit);
      const bool visible = IsVisible(*groove, {x, 0.0, groove->At(x, 0).height_mm}, to_light, 1e6);
      (visible ? lit : dark) = x;
    }
    EXPECT_NEAR(lit, edge, 1e-5 * half_width) << elevation_deg;
  }
}

TEST(Surface, ErrorsNameTheFieldAndItsRange) {
  const auto message = [](const Result<SurfacePtr>& surface) {
    return surface ? std::string("made") : surface.error().message;
  };
  EXPECT_THAT(message(MakePlane(1.6, 0)), HasSubstr("slope_rad = 1.6; need 0 <= slope_rad < pi/2"));
  EXPECT_THAT(message(MakeSphereCap(-1, 1)), HasSubstr("radius_mm = -1; need radius_mm > 0"));
  EXPECT_THAT(message(MakeSphereCap(1, 0)), HasSubstr("edge_rad"));
  EXPECT_THAT(message(MakeGroove(0, 1)), HasSubstr("depth_mm"));
  EXPECT_THAT(message(MakeGroove(1, 4)), HasSubstr("opening_rad"));
  EXPECT_THAT(message(MakeSteps(0, 1, 1, 1)), HasSubstr("count"));
  EXPECT_THAT(message(MakeSteps(1, 1, 1, 2)), HasSubstr("riser_mm"));
  EXPECT_THAT(message(MakeWaves(0, 1)), HasSubstr("period_mm"));
  EXPECT_THAT(message(MakeHeightMap(Image<float>(1, 5), 1)), HasSubstr("1x5"));
  EXPECT_THAT(message(MakeHeightMap(Bumps(), 0)), HasSubstr("pitch_mm"));
  EXPECT_THAT(message(MakeWeave({.fill = 1.5})), HasSubstr("fill = 1.5; need 0 < fill <= 1"));
  EXPECT_THAT(message(MakeWeave({.amplitude_mm = -1})), HasSubstr("amplitude_mm"));
}

}  // namespace
}  // namespace sateen::surface_test
