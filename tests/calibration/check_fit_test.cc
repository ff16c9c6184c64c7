#include "calibration/check/check_fit.h"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/angle.h"
#include "tests/calibration/actual_over_predicted.h"
#include "tests/calibration/synthetic_readings.h"

namespace sateen::check_fit_test {
namespace {

using sateen::testing::ActualOverPredicted;
using sateen::testing::CalibratedRig;
using sateen::testing::ReadingsOf;

constexpr double kAlbedo = 0.99;

// One weight for all samples: 1 where the samples' own standard deviations are right.
SampleWeights AllWeights(const std::vector<SheetReadings>& sheets, double weight) {
  SampleWeights weights(sheets[0].samples.size());
  for (size_t k = 0; k < weights.size(); ++k) {
    for (const SheetReadings& sheet : sheets) {
      weights[k].emplace_back(sheet.samples[k].size(), weight);
    }
  }
  return weights;
}

ChangeMask NothingOf(size_t lights) {
  return {.moved = std::vector<bool>(lights), .turned = std::vector<bool>(lights)};
}

TEST(FitChange, WithoutDataThePriorsAreTheAnswer) {
  const Rig rig = CalibratedRig(LightModel::kLed);
  const std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 2, 1, {6, 4});
  const CheckModel model(rig, sheets, kAlbedo);
  RigChange start = model.Unchanged();
  for (LightChange& light : start.lights) {
    light = {{6.0, -6.0, 3.0}, {200.0, -100.0, 50.0}, {0.5, -0.5}};
  }
  start.camera = {80.0, -60.0, 40.0, 0.1};
  start.sheets = {SheetHeights::Constant(7.0), SheetHeights::Constant(-4.0)};
  const std::vector<bool> all(rig.lights.size(), true);

  const ChangeFit fit =
      FitChange(model, AllWeights(sheets, 0.0),
                {.moved = all, .turned = all, .camera = true, .sheets = true}, start, {});

  EXPECT_LT(fit.chi2, 1e-20);
  EXPECT_LT(fit.change.camera.norm() + fit.change.sheets[1].norm(), 1e-9);
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    const LightChange& light = fit.change.lights[k];
    EXPECT_LT(light.log_flux.norm() + light.moved_mm.norm() + light.turned_rad.norm(), 1e-9);
    EXPECT_TRUE(fit.flux[k].isApprox(9.0 * Eigen::Matrix3d::Identity(), 1e-9));
    EXPECT_TRUE(fit.moved_mm2[k].isApprox(1e4 * Eigen::Matrix3d::Identity(), 1e-9));
    const double turned_sd = 20.0 * kRadPerDeg;
    EXPECT_TRUE(
        fit.turned_rad2[k].isApprox(turned_sd * turned_sd * Eigen::Matrix2d::Identity(), 1e-9));
  }
  const Eigen::Vector4d camera_sd(50.0, 50.0, 50.0, 5.0 * kRadPerDeg);
  EXPECT_TRUE(fit.camera.diagonal().isApprox(camera_sd.cwiseAbs2(), 1e-9));
}

TEST(FitChange, StandardDeviationsAreThoseOfTheErrors) {
  const Rig rig = CalibratedRig(LightModel::kLed);
  ChangeMask lights = NothingOf(10);
  lights.moved[2] = lights.moved[5] = lights.turned[5] = lights.turned[7] = true;
  ChangeMask camera = NothingOf(10);
  camera.camera = true;
  ActualOverPredicted flux;
  ActualOverPredicted moved;
  ActualOverPredicted turned;
  ActualOverPredicted of_camera;
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 3, 100 + seed, {9, 6});
    const CheckModel model(rig, sheets, kAlbedo);
    const SampleWeights weights = AllWeights(sheets, 1.0);
    const ChangeFit fit = FitChange(model, weights, lights, model.Unchanged(), {});
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      const LightChange& light = fit.change.lights[k];
      flux.Add(light.log_flux, fit.flux[k]);
      if (lights.moved[k]) {
        moved.Add(light.moved_mm, fit.moved_mm2[k]);
      }
      if (lights.turned[k]) {
        turned.Add(light.turned_rad, fit.turned_rad2[k]);
      }
    }
    const ChangeFit alone = FitChange(model, weights, camera, model.Unchanged(), {});
    of_camera.Add(alone.change.camera, alone.camera);
  }
  fmt::print(
      "errors over standard deviations: flux {:.3f}, move {:.3f}, turn {:.3f}, camera {:.3f}\n",
      flux.Ratio(), moved.Ratio(), turned.Ratio(), of_camera.Ratio());
  EXPECT_NEAR(flux.Ratio(), 1.0, 0.04);
  EXPECT_NEAR(moved.Ratio(), 1.0, 0.09);  // from 600 figures
  EXPECT_NEAR(turned.Ratio(), 1.0, 0.11);
  EXPECT_NEAR(of_camera.Ratio(), 1.0, 0.11);
}

// The fit gains as much as was promised.
TEST(GainsOf, AreWhatAFitGains) {
  const Rig rig = CalibratedRig(LightModel::kLed);
  Rig actual = rig;
  actual.lights[4].position_mm += Eigen::Vector3d(0.3, -0.2, 0.2);
  actual.lights[6].axis = (rig.lights[6].axis + Eigen::Vector3d(0.01, 0.0, 0.0)).normalized();
  const std::vector<SheetReadings> sheets = ReadingsOf(rig, actual, 3, 3);
  const CheckModel model(rig, sheets, kAlbedo);
  const SampleWeights weights = AllWeights(sheets, 1.0);
  const ChangeFit before = FitChange(model, weights, NothingOf(10), model.Unchanged(), {});

  const std::vector<ChangeGain> gains = GainsOf(model, weights, before, {});

  ChangeMask mask = NothingOf(10);
  mask.moved[4] = true;
  const ChangeFit moved = FitChange(model, weights, mask, before.change, {});
  EXPECT_GT(gains[4].moved, 100.0);
  EXPECT_NEAR(gains[4].moved, before.chi2 - moved.chi2, 0.02 * gains[4].moved);
  EXPECT_TRUE(gains[4].moved_mm2.isApprox(moved.moved_mm2[4], 0.01));
  mask = NothingOf(10);
  mask.turned[6] = true;
  const ChangeFit turned = FitChange(model, weights, mask, before.change, {});
  EXPECT_GT(gains[6].turned, 100.0);
  EXPECT_NEAR(gains[6].turned, before.chi2 - turned.chi2, 0.02 * gains[6].turned);
}

TEST(GainsOf, WithoutDataNothingIsGainedAndThePriorIsKnown) {
  const Rig rig = CalibratedRig(LightModel::kLed);
  const std::vector<SheetReadings> sheets = ReadingsOf(rig, rig, 1, 4, {6, 4});
  const CheckModel model(rig, sheets, kAlbedo);
  SampleWeights weights = AllWeights(sheets, 0.0);
  weights[9].clear();  // takes no part

  const std::vector<ChangeGain> gains = GainsOf(model, weights, {.change = model.Unchanged()}, {});

  EXPECT_EQ(gains[0].moved, 0.0);
  EXPECT_EQ(gains[0].turned, 0.0);
  EXPECT_TRUE(gains[0].moved_mm2.isApprox(1e4 * Eigen::Matrix3d::Identity(), 1e-9));
  EXPECT_TRUE(gains[9].moved_mm2.isZero());
}

}  // namespace
}  // namespace sateen::check_fit_test
