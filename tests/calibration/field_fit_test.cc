#include "calibration/lights/field_fit.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calibration/lights/field_equations.h"
#include "calibration/lights/light_fit.h"
#include "rig/projection.h"
#include "simulation/rigs.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::field_fit_test {
namespace {

using sateen::testing::SamplesOf;
using sateen::testing::SyntheticCamera;
using ::testing::HasSubstr;

SyntheticCamera FullCamera() {
  return {.camera = OverheadCamera({4928, 3264}, 610.0, 300.0), .columns = 48, .rows = 32};
}

// An LED of the ring whose lens leaves rings of 3 %.
Light RingedLed() {
  Light light = LedRing(LightModel::kLedField, 10, 45.0 * kRadPerDeg, 600.0)[3];
  light.flux_rgb = {0.40, 0.36, 0.30};
  return light;
}

Light Rough(const Light& light, double off_mm) {
  Light rough = light;
  rough.model = LightModel::kNear;
  rough.field = {};
  rough.position_mm += off_mm * Eigen::Vector3d(2.0, -1.0, 2.0).normalized();
  rough.flux_rgb.setOnes();
  return rough;
}

double WorstDirectionDeg(const Light& a, const Light& b, const std::vector<SheetSample>& samples) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d la = IncidentAt(a, sample.point_mm).l;
    const Eigen::Vector3d lb = IncidentAt(b, sample.point_mm).l;
    worst = std::max(worst, std::atan2(la.cross(lb).norm(), la.dot(lb)));
  }
  return worst / kRadPerDeg;
}

// The largest relative error of the irradiance, which flux and gain share.
double WorstIrradiance(const Light& a, const Light& b, const std::vector<SheetSample>& samples) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d ratio =
        IncidentAt(a, sample.point_mm).e_rgb.cwiseQuotient(IncidentAt(b, sample.point_mm).e_rgb);
    worst = std::max(worst, (ratio - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff());
  }
  return worst;
}

TEST(ShadingOf, IsThatOfTheLightAndItsDerivativesAreNumericOnes) {
  Light led = LedRing(LightModel::kLed, 10, 45.0 * kRadPerDeg, 600.0)[3];
  led.axis = (led.axis + Eigen::Vector3d(0.1, 0.2, 0.0)).normalized();
  led.anisotropy = 1.7;
  SheetSample sample;
  sample.point_mm = {80.0, -60.0, 13.0};
  sample.normal = Eigen::Vector3d(0.1, -0.15, 1.0).normalized();
  const SheetShading shading = ShadingOf(sample, led);
  const TableShadow shadow = ShadowOf(sample, led);
  const Incident in = IncidentAt(led, sample.point_mm);
  EXPECT_NEAR(shading.value, in.e_rgb[0] * sample.normal.dot(in.l), 1e-12);
  constexpr double kStepMm = 1e-3;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Light more = led;
    Light less = led;
    more.position_mm[axis] += kStepMm;
    less.position_mm[axis] -= kStepMm;
    EXPECT_NEAR(shading.by_position[axis],
                (ShadingOf(sample, more).value - ShadingOf(sample, less).value) / (2.0 * kStepMm),
                1e-9);
    const Eigen::Vector2d slope =
        (ShadowOf(sample, more).at_mm - ShadowOf(sample, less).at_mm) / (2.0 * kStepMm);
    EXPECT_TRUE(shadow.by_position.col(axis).isApprox(slope, 1e-6)) << axis;
  }
  led.axis = -led.axis;
  EXPECT_EQ(ShadingOf(sample, led).value, 0.0);  // behind
}

// The truth of this test: near and led do not explain the light, the field does, and with tilted
// sheets the light comes out as well as without rings.
TEST(FitField, ExplainsALensThatNearAndLedDoNot) {
  const Light truth = RingedLed();
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 21);

  const Result<LightFit> fitted = FitLight(samples, Rough(truth, 15.0));
  ASSERT_TRUE(fitted) << fitted.error().message;
  const LightFit& fit = *fitted;

  for (const RungFit& rung : fit.rungs) {
    fmt::print("{}: held out {:.2f} x noise, {} steps, roughness {:g}\n", Name(rung.light.model),
               rung.held_out_rms / fit.noise_rms, rung.iterations, rung.roughness_weight);
  }
  fmt::print(
      "position {:.3f} mm (sd {:.3f}), direction {:.4f} deg (sd {:.4f}), irradiance {:.2e}\n",
      (fit.light.position_mm - truth.position_mm).norm(), fit.position_sd_mm.norm(),
      WorstDirectionDeg(fit.light, truth, samples), fit.direction_sd_rad / kRadPerDeg,
      WorstIrradiance(fit.light, truth, samples));
  ASSERT_EQ(fit.rungs.size(), 3U);
  EXPECT_GT(fit.rungs[0].held_out_rms, 5.0 * fit.noise_rms);
  EXPECT_GT(fit.rungs[1].held_out_rms, 5.0 * fit.noise_rms);
  EXPECT_LT(fit.rungs[2].held_out_rms, 1.1 * fit.noise_rms);
  EXPECT_EQ(fit.light.model, LightModel::kLedField);
  EXPECT_LT(WorstDirectionDeg(fit.light, truth, samples), 0.01);
  EXPECT_LT((fit.light.position_mm - truth.position_mm).norm(), 0.1);
  EXPECT_LT(WorstIrradiance(fit.light, truth, samples), 1e-3);
}

// One flat sheet does not tell the position, so the light stays near the ruler, and all of the
// sheet is explained.
TEST(FitField, OneFlatSheetLeavesTheLightWithTheRuler) {
  const Light truth = RingedLed();
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 22);
  const Light rough = Rough(truth, 15.0);

  const LightFit fit = FitLight(samples, rough).value();

  const double ruler_deg = WorstDirectionDeg(rough, truth, samples);
  const double off_deg = WorstDirectionDeg(fit.light, truth, samples);
  fmt::print(
      "one flat sheet: direction {:.3f} deg off (sd {:.3f}), by the ruler {:.3f}; {:.2f} x noise\n",
      off_deg, fit.direction_sd_rad / kRadPerDeg, ruler_deg,
      fit.rungs.back().held_out_rms / fit.noise_rms);
  EXPECT_EQ(fit.light.model, LightModel::kLedField);
  EXPECT_LT(off_deg, 1.2 * ruler_deg);
  EXPECT_GT(fit.direction_sd_rad / kRadPerDeg, 0.3 * off_deg);  // and says so
  EXPECT_LT(fit.rungs.back().held_out_rms, 1.1 * fit.noise_rms);
}

TEST(FitField, TheGainIsOneInTheMean) {
  const Light truth = RingedLed();
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 23);

  const LightFit fit = FitLight(samples, Rough(truth, 5.0)).value();
  double mean = 0.0;
  for (const SheetSample& sample : samples) {
    mean += fit.light.field.At(ShadowOnTable(fit.light.position_mm, sample.point_mm)) /
            static_cast<double>(samples.size());
  }
  EXPECT_NEAR(mean, 1.0, 1e-4);  // mean over the samples that were used
}

TEST(FitField, NoLightGetsAFieldThatItDoesNotNeed) {
  Light truth = RingedLed();
  truth.model = LightModel::kLed;
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 24);
  const LightFit fit = FitLight(samples, Rough(truth, 15.0)).value();
  EXPECT_EQ(fit.light.model, LightModel::kLed);
  EXPECT_EQ(fit.rungs.size(), 2U);
}

TEST(FitField, DustDoesNotBecomeGain) {
  const Light truth = RingedLed();
  std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 25);
  const std::vector<SheetSample> clean = samples;
  // Not in the very corner, where a speck has no neighbours to contradict it and takes 2 % of gain.
  for (size_t i = 25; i < samples.size(); i += 50) {
    samples[i].radiance_rgb *= 0.7;
  }
  const LightFit fit = FitLight(samples, Rough(truth, 15.0)).value();
  EXPECT_EQ(fit.light.model, LightModel::kLedField);
  EXPECT_LT(WorstIrradiance(fit.light, truth, clean),
            2e-3);  // 1.5e-3 at the border, fewer neighbours
  EXPECT_GT(fit.left_out, samples.size() / 60);
}

TEST(FitField, ErrorsNameTheirReason) {
  const Light truth = RingedLed();
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 26);
  const auto message = [&](const Light& light, const FieldFitOptions& options) {
    return FitField(samples, light, {0, 1, 2}, {}, 1.0, options).error().message;
  };
  EXPECT_THAT(message(Rough(truth, 0.0), {}), HasSubstr("of the rung near; need led"));
  Light led = truth;
  led.model = LightModel::kLed;
  EXPECT_THAT(message(led, {.position_sd_mm = 0.0}), HasSubstr("position_sd_mm = 0; need"));
  EXPECT_THAT(message(led, {.spacing_mm = 0.0}), HasSubstr("spacing_mm = 0; need a number > 0"));
  EXPECT_THAT(message(led, {.gain_sd = -1.0}), HasSubstr("gain_sd = -1; need a number > 0"));
  EXPECT_THAT(message(led, {.most_iterations = 0}), HasSubstr("most_iterations = 0; need 1"));
  EXPECT_THAT(message(led, {.albedo = 2.0}), HasSubstr("albedo = 2; need 0 < albedo <= 1"));
}

}  // namespace
}  // namespace sateen::field_fit_test
