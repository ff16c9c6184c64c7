#include "calibration/sheet/sheet_fault.h"

#include <gtest/gtest.h>

#include <functional>

#include "rig/projection.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::sheet_fault_test {
namespace {

using namespace sateen::testing;

// A flat sheet under six lights; `spoil` may change a sample at (x, y).
struct Seen {
  std::vector<std::vector<SheetSample>> samples;
  std::vector<std::vector<int>> blocks;
  Lights lights;
};

Seen SheetWith(const std::function<void(size_t light, SheetSample& sample)>& spoil) {
  const SyntheticCamera camera{.camera = OverheadCamera({640, 480}, 610.0, 200.0)};
  Seen seen;
  for (size_t k = 0; k < 6; ++k) {
    const double angle = static_cast<double>(k);
    seen.lights.push_back({.name = "led",
                           .model = LightModel::kNear,
                           .position_mm = {400.0 * std::cos(angle), 400.0 * std::sin(angle), 420.0},
                           .flux_rgb = {0.36, 0.36, 0.36}});
    seen.samples.push_back(SamplesOf(camera, seen.lights[k], 1, 5 + k));
    seen.blocks.emplace_back();
    for (size_t i = 0; i < seen.samples[k].size(); ++i) {
      spoil(k, seen.samples[k][i]);
      seen.blocks[k].push_back(static_cast<int>(i));
    }
  }
  return seen;
}

std::optional<SheetFault> FaultOf(const Seen& seen) {
  return FindSheetFault({.columns = 64, .rows = 42, .samples = seen.samples, .blocks = seen.blocks},
                        seen.lights, 0.99);
}

TEST(FindSheetFault, NoiseIsNone) {
  EXPECT_FALSE(FaultOf(SheetWith([](size_t, SheetSample&) {})));
}

// A fold turned by 0.5 rad through (10, -5): dimmer on one flank, as its normal leans away.
TEST(FindSheetFault, AFoldIsALine) {
  const Seen seen = SheetWith([](size_t light, SheetSample& sample) {
    const Eigen::Vector2d from = sample.point_mm.head<2>() - Eigen::Vector2d(10.0, -5.0);
    if (std::abs(Eigen::Vector2d(std::sin(0.5), -std::cos(0.5)).dot(from)) < 2.0) {
      sample.radiance_rgb *= light == 3 ? 0.8 : 0.95;
    }
  });
  const std::optional<SheetFault> fault = FaultOf(seen);
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->shape, FaultShape::kLine);
  EXPECT_NEAR(fault->center_mm.x(), 10.0, 12.0);  // where the sheet is cut by the picture
  EXPECT_NEAR(fault->share, 0.026, 0.006);
  EXPECT_GT(fault->length_mm, 120.0);
  EXPECT_NEAR(fault->width_mm, 3.5, 1.5);
}

TEST(FindSheetFault, WhatLiesBeyondThePaperIsItsRim) {
  const Seen seen = SheetWith([](size_t, SheetSample& sample) {
    if (sample.point_mm.x() > 90.0) {
      sample.radiance_rgb *= 0.2;
    }
  });
  const std::optional<SheetFault> fault = FaultOf(seen);
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->shape, FaultShape::kRim);
  EXPECT_NEAR(fault->share, 0.05, 0.01);
}

TEST(FindSheetFault, AStainIsASpot) {
  const Seen seen = SheetWith([](size_t, SheetSample& sample) {
    if ((sample.point_mm.head<2>() - Eigen::Vector2d(-30.0, 20.0)).norm() < 9.0) {
      sample.radiance_rgb *= 0.9;
    }
  });
  const std::optional<SheetFault> fault = FaultOf(seen);
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->shape, FaultShape::kSpots);
  EXPECT_NEAR(fault->center_mm.x(), -30.0, 1.0);
  EXPECT_NEAR(fault->center_mm.y(), 20.0, 1.0);
}

// A deviation under one light alone is not the paper's fault.
TEST(FindSheetFault, AShadowOfOneLightIsNone) {
  EXPECT_FALSE(FaultOf(SheetWith([](size_t light, SheetSample& sample) {
    if (light == 2 && sample.point_mm.x() < -60.0) {
      sample.radiance_rgb *= 0.5;
    }
  })));
}

TEST(FindSheetFault, NamesTheLightUnderWhichMostShows) {
  const Seen seen = SheetWith([](size_t light, SheetSample& sample) {
    const double reach = light == 4 ? 15.0 : 10.0;
    if (sample.point_mm.head<2>().norm() < reach) {
      sample.radiance_rgb *= 0.9;
    }
  });
  ASSERT_TRUE(FaultOf(seen));
  EXPECT_EQ(FaultOf(seen)->worst_light, 4U);
}

}  // namespace
}  // namespace sateen::sheet_fault_test
