#include "calibration/lights/light_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "rig/projection.h"
#include "simulation/rigs.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::light_fit_test {
namespace {

using sateen::testing::SamplesOf;
using sateen::testing::SyntheticCamera;
using ::testing::HasSubstr;

// The camera of the scanner of The Order: 1886 above the table.
SyntheticCamera FullCamera() { return {.camera = OverheadCamera({4928, 3264}, 610.0, 300.0)}; }

// A light of the ring, and where a ruler might say that it is.
Light TrueLight(LightModel model, double anisotropy = 0.0) {
  Light light = LedRing(model, 10, 45.0 * kRadPerDeg, 600.0)[3];
  light.flux_rgb = {0.40, 0.36, 0.30};
  light.anisotropy = anisotropy;
  return light;
}

Light RoughLight(const Light& light, double off_mm, uint64_t seed) {
  Light rough = light;
  rough.model = LightModel::kNear;
  const Eigen::Vector3d away(NormalDeviate(seed, 0), NormalDeviate(seed, 1),
                             NormalDeviate(seed, 2));
  rough.position_mm += off_mm * away.normalized();
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

double WorstFlux(const Light& a, const Light& b) {
  return (a.flux_rgb.cwiseQuotient(b.flux_rgb) - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff();
}

TEST(FitLight, OneFlatSheetGivesDirections) {
  const Light truth = TrueLight(LightModel::kNear);
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 7);

  const LightFit fit = FitLight(samples, RoughLight(truth, 15.0, 8)).value();

  EXPECT_EQ(fit.light.model, LightModel::kNear);
  EXPECT_LT(WorstDirectionDeg(fit.light, truth, samples), 0.25);  // measured 0.005
  EXPECT_EQ(fit.light.name, truth.name);
}

// A flat sheet hardly tells height from flux, and well what the two together send to the table.
TEST(FitLight, SaysHowWellTheIrradianceIsKnown) {
  const Light truth = TrueLight(LightModel::kNear);
  constexpr int kFits = 24;
  double squares = 0.0;
  double predicted = 0.0;
  double flux_squared = 0.0;
  for (uint64_t seed = 0; seed < kFits; ++seed) {
    const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 100 + seed);
    const LightFit fit = FitLight(samples, RoughLight(truth, 15.0, 200 + seed)).value();
    const Eigen::Vector3d ratio =
        IncidentAt(fit.light, Eigen::Vector3d::Zero())
            .e_rgb.cwiseQuotient(IncidentAt(truth, Eigen::Vector3d::Zero()).e_rgb);
    squares += (ratio - Eigen::Vector3d::Ones()).squaredNorm() / 3.0;
    predicted += std::pow(fit.light.irradiance_sd.value(), 2.0);
    flux_squared += fit.flux_sd.squaredNorm() / 3.0;
  }
  EXPECT_NEAR(std::sqrt(squares / predicted), 1.0, 0.35);
  EXPECT_LT(predicted, 0.25 * flux_squared);
}

TEST(FitLight, AFlatSheetAndFourTiltsGivePositionAndFlux) {
  for (const double anisotropy : {0.0, 1.5}) {
    const LightModel model = anisotropy > 0.0 ? LightModel::kLed : LightModel::kNear;
    const Light truth = TrueLight(model, anisotropy);
    const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 9);

    const LightFit fit = FitLight(samples, RoughLight(truth, 15.0, 10)).value();

    EXPECT_EQ(fit.light.model, model);  // no higher rung than the light has
    EXPECT_LT((fit.light.position_mm - truth.position_mm).norm(), 0.1);
    EXPECT_LT(WorstDirectionDeg(fit.light, truth, samples), 0.01);
    EXPECT_LT(WorstFlux(fit.light, truth), 1e-3);
    if (model == LightModel::kLed) {
      EXPECT_NEAR(fit.light.anisotropy, 1.5, 0.01);
      EXPECT_LT((fit.light.axis - truth.axis).norm(), 0.01);
    }
  }
}

TEST(FitLight, AnLedSeenAsAPointIsNotBelieved) {
  const Light truth = TrueLight(LightModel::kLed, 3.0);
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 11);

  const LightFit point =
      FitLight(samples, RoughLight(truth, 5.0, 12), {.highest_rung = LightModel::kNear}).value();

  EXPECT_GT(point.rungs[0].held_out_rms, 5.0 * point.noise_rms);
  const LightFit led = FitLight(samples, RoughLight(truth, 5.0, 12)).value();
  ASSERT_EQ(led.rungs.size(), 2U);
  EXPECT_LT(led.rungs[1].held_out_rms, 1.1 * led.noise_rms);
}

TEST(FitLight, DustAndAFoldAreLeftOut) {
  const Light truth = TrueLight(LightModel::kNear);
  std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 13);
  for (size_t i = 0; i < samples.size(); i += 50) {
    samples[i].radiance_rgb *= 0.7;  // dust
  }
  for (size_t i = 20 * 64; i < 23 * 64; ++i) {
    samples[i].radiance_rgb *= 1.06;  // a fold across the flat sheet
  }

  const LightFit fit = FitLight(samples, RoughLight(truth, 15.0, 14)).value();

  EXPECT_LT((fit.light.position_mm - truth.position_mm).norm(), 0.1);
  EXPECT_GT(fit.left_out, samples.size() / 50);
  EXPECT_LT(fit.left_out, samples.size() / 20);
}

TEST(FitLight, PaperOfAnotherWhitenessChangesTheFluxAlone) {
  const Light truth = TrueLight(LightModel::kNear);
  const std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 5, 15);

  const LightFit fit = FitLight(samples, RoughLight(truth, 5.0, 16), {.albedo = 0.9}).value();

  EXPECT_NEAR(fit.light.flux_rgb[0], truth.flux_rgb[0] * 0.99 / 0.9, 1e-3);
  EXPECT_LT((fit.light.position_mm - truth.position_mm).norm(), 0.1);
}

TEST(FitLight, ErrorsSayWhatToDo) {
  const Light truth = TrueLight(LightModel::kNear);
  std::vector<SheetSample> samples = SamplesOf(FullCamera(), truth, 1, 17);
  Light distant = truth;
  distant.model = LightModel::kDistant;
  EXPECT_THAT(FitLight(samples, distant).error().message, HasSubstr("need its position_mm"));
  EXPECT_THAT(FitLight(samples, truth, {.albedo = 1.2}).error().message,
              HasSubstr("albedo = 1.2; need 0 < albedo <= 1"));
  EXPECT_THAT(FitLight({samples.begin(), samples.begin() + 40}, truth).error().message,
              HasSubstr("40 samples of the sheet; need at least 50"));
  for (SheetSample& sample : samples) {
    sample.radiance_rgb.setZero();
  }
  EXPECT_THAT(FitLight(samples, truth).error().message, HasSubstr("never on"));
}

}  // namespace
}  // namespace sateen::light_fit_test
