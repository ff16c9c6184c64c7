#include "calibration/lights/seed_procedure.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calibration/lights/light_fit.h"
#include "calibration/sheet/flatness.h"
#include "rig/projection.h"
#include "simulation/rigs.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::seed_procedure_test {
namespace {

using sateen::testing::SamplesOf;
using sateen::testing::SheetNormals;
using sateen::testing::SyntheticCamera;
using ::testing::HasSubstr;

// Ten lights, and what a flat sheet and one tilted by ten degrees show of them.
struct TwoSheets {
  SyntheticCamera camera{.camera = OverheadCamera({4928, 3264}, 610.0, 300.0)};
  Lights truth;
  std::vector<Eigen::Vector3d> ruler_mm;
  std::vector<std::vector<SheetSample>> flat;
  std::vector<std::vector<SheetSample>> tilted;
  std::vector<std::vector<int>> blocks;

  explicit TwoSheets(double anisotropy, double off_mm = 15.0) {
    truth = LedRing(LightModel::kLed, 10, 45.0 * kRadPerDeg, 600.0);
    const auto count = static_cast<size_t>(camera.columns) * static_cast<size_t>(camera.rows);
    for (size_t k = 0; k < truth.size(); ++k) {
      truth[k].anisotropy = anisotropy;
      truth[k].flux_rgb = {0.40, 0.36, 0.30};
      const Eigen::Vector3d away(NormalDeviate(k, 0), NormalDeviate(k, 1), NormalDeviate(k, 2));
      ruler_mm.emplace_back(truth[k].position_mm + off_mm * away.normalized());
      const std::vector<SheetSample> both = SamplesOf(camera, truth[k], 2, 50 + k);
      const auto middle = both.begin() + static_cast<std::ptrdiff_t>(count);
      flat.emplace_back(both.begin(), middle);
      tilted.emplace_back(middle, both.end());
      blocks.emplace_back(count);
      for (size_t i = 0; i < count; ++i) {
        blocks[k][i] = static_cast<int>(i);
      }
    }
  }

  [[nodiscard]] std::vector<SeedLight> Calibrate(const SeedProcedureOptions& options) const {
    std::vector<SeedLight> lights;
    for (size_t k = 0; k < truth.size(); ++k) {
      lights.push_back(CalibrateBySeedProcedure(flat[k], blocks[k], camera.columns, camera.rows,
                                                ruler_mm[k], options)
                           .value());
    }
    return lights;
  }

  [[nodiscard]] double WorstDeg(const std::vector<std::vector<SheetSample>>& samples,
                                const IncidentOf& incident) const {
    const SheetReadings view{
        .columns = camera.columns, .rows = camera.rows, .samples = samples, .blocks = blocks};
    return FlatnessOf(view, incident).value().worst_rad / kRadPerDeg;
  }

  [[nodiscard]] double WorstDeg(const std::vector<std::vector<SheetSample>>& samples,
                                const std::vector<SeedLight>& lights) const {
    return WorstDeg(samples, [&](size_t k, size_t i) {
      return IncidentAt(lights[k], blocks[k][i], samples[k][i].point_mm);
    });
  }

  [[nodiscard]] double WorstOffMm(const std::vector<SeedLight>& lights) const {
    double worst = 0.0;
    for (size_t k = 0; k < truth.size(); ++k) {
      worst = std::max(worst, (lights[k].position_mm - truth[k].position_mm).norm());
    }
    return worst;
  }
};

TEST(Flatness, TrueLightsSolveFlatToTheNoise) {
  const TwoSheets sheets(1.0);
  const SheetReadings view{.columns = sheets.camera.columns,
                           .rows = sheets.camera.rows,
                           .samples = sheets.flat,
                           .blocks = sheets.blocks};
  const Flatness flat = FlatnessOf(view, sheets.truth).value();
  fmt::print("true lights: worst {:.2e} deg over {} tiles\n", flat.worst_rad / kRadPerDeg,
             flat.tiles);
  EXPECT_EQ(flat.tiles, 12 * 8);                  // 300 x 198 mm
  EXPECT_LT(flat.worst_rad / kRadPerDeg, 0.003);  // 25 blocks whose normal has 0.004 degrees
  EXPECT_GT(flat.rms_rad, 0.0);
  EXPECT_LE(flat.rms_rad, flat.worst_rad);
}

// A light whose intensity is taken too high by a share f turns each normal by a known angle.
TEST(Flatness, IsTheAngleThatAWrongIntensityCauses) {
  const TwoSheets sheets(0.0);
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  for (const Light& light : sheets.truth) {
    const Eigen::Vector3d l = light.position_mm.normalized();
    a += l * l.transpose();
  }
  const Eigen::Vector3d l3 = sheets.truth[3].position_mm.normalized();
  const Eigen::Vector3d n =
      Eigen::Vector3d::UnitZ() + a.inverse() * l3 * l3.z() * (1.0 / 1.02 - 1.0);
  const double expected_deg = std::acos(n.normalized().z()) / kRadPerDeg;  // at the origin

  Lights wrong = sheets.truth;
  wrong[3].flux_rgb *= 1.02;
  const SheetReadings view{.columns = sheets.camera.columns,
                           .rows = sheets.camera.rows,
                           .samples = sheets.flat,
                           .blocks = sheets.blocks};
  const Flatness flat = FlatnessOf(view, wrong, {.tile_mm = 1000.0}).value();

  EXPECT_EQ(flat.tiles, 1);
  EXPECT_NEAR(flat.worst_rad / kRadPerDeg, expected_deg,
              0.05 * expected_deg);  // median over the field
}

TEST(Flatness, DustDoesNotCountAndASheetUnseenIsAnError) {
  TwoSheets sheets(0.0);
  for (std::vector<SheetSample>& samples : sheets.flat) {
    for (size_t i = 0; i < samples.size(); i += 40) {
      samples[i].radiance_rgb *= 0.5 + 0.05 * static_cast<double>(i % 7);
    }
  }
  EXPECT_LT(sheets.WorstDeg(sheets.flat,
                            [&](size_t k, size_t i) {
                              return IncidentAt(sheets.truth[k], sheets.flat[k][i].point_mm);
                            }),
            0.005);
  sheets.flat.resize(2);
  sheets.blocks.resize(2);
  const SheetReadings view{.columns = sheets.camera.columns,
                           .rows = sheets.camera.rows,
                           .samples = sheets.flat,
                           .blocks = sheets.blocks};
  EXPECT_THAT(FlatnessOf(view, sheets.truth).error().message, HasSubstr("seen under 3 lights"));
  EXPECT_THAT(FlatnessOf(view, sheets.truth, {.tile_mm = 0.0}).error().message,
              HasSubstr("tile_mm = 0; need a number > 0"));
}

// The start: one intensity per light cannot follow the fall-off over distance.
TEST(SeedProcedure, OneIntensityALightLeavesManyDegrees) {
  const TwoSheets sheets(0.0);
  std::vector<Eigen::Vector3d> intensity;
  for (size_t k = 0; k < sheets.truth.size(); ++k) {
    intensity.push_back(IntensityAtCentre(sheets.flat[k], sheets.ruler_mm[k], 0.99));
  }
  // At the true place the figure is that of the light, but for the noise.
  const Incident at_origin = IncidentAt(sheets.truth[0], {0, 0, 0});
  EXPECT_NEAR(IntensityAtCentre(sheets.flat[0], sheets.truth[0].position_mm, 0.99).x() /
                  at_origin.e_rgb.x(),
              1.0, 0.01);  // a block beside the origin

  const double worst_deg = sheets.WorstDeg(sheets.flat, [&](size_t k, size_t i) {
    return Incident{(sheets.ruler_mm[k] - sheets.flat[k][i].point_mm).normalized(), intensity[k]};
  });
  fmt::print("one intensity a light: {:.1f} deg\n", worst_deg);
  EXPECT_GT(worst_deg, 5.0);
}

// To the letter: the sheet itself comes out flat, the light stays where the ruler put it, and a
// sheet that is tilted shows it.
TEST(SeedProcedure, TheEquationLeavesTheLightWhereItWas) {
  const TwoSheets sheets(1.0);
  const std::vector<SeedLight> unsmoothed = sheets.Calibrate({.smoothing_passes = 0});
  const std::vector<SeedLight> lights = sheets.Calibrate({.most_rounds = 5});
  for (size_t k = 0; k < lights.size(); ++k) {
    EXPECT_TRUE(unsmoothed[k].converged);
    EXPECT_EQ(unsmoothed[k].rounds, 1);
    EXPECT_LT((unsmoothed[k].position_mm - sheets.ruler_mm[k]).norm(), 1e-6) << k;
    EXPECT_LT((lights[k].position_mm - sheets.ruler_mm[k]).norm(), 4.0) << k;
  }
  const double flat_deg = sheets.WorstDeg(sheets.flat, lights);
  const double tilted_deg = sheets.WorstDeg(sheets.tilted, lights);
  fmt::print("equation: off {:.1f} mm; flat {:.4f} deg, tilted {:.3f} deg\n",
             sheets.WorstOffMm(lights), flat_deg, tilted_deg);
  EXPECT_LT(flat_deg, 0.05);
  EXPECT_GT(tilted_deg, 0.1);
}

TEST(SeedProcedure, TheFallOffFindsAPointLight) {
  const TwoSheets sheets(0.0);
  const std::vector<SeedLight> lights =
      sheets.Calibrate({.direction_step = DirectionStep::kFallOff});
  for (const SeedLight& light : lights) {
    EXPECT_TRUE(light.converged);
    EXPECT_GT(light.rounds, 5);  // the error halves from round to round
  }
  fmt::print("fall-off, point lights: off {:.2f} mm after {} rounds; tilted {:.4f} deg\n",
             sheets.WorstOffMm(lights), lights[0].rounds, sheets.WorstDeg(sheets.tilted, lights));
  EXPECT_LT(sheets.WorstOffMm(lights), 1.0);  // the noise of one flat sheet
  EXPECT_LT(sheets.WorstDeg(sheets.tilted, lights), 0.02);
}

TEST(SeedProcedure, TheFallOffIsLedAstrayByAnLed) {
  const TwoSheets sheets(1.0);
  const std::vector<SeedLight> lights =
      sheets.Calibrate({.direction_step = DirectionStep::kFallOff});
  fmt::print("fall-off, LEDs: off {:.1f} mm; flat {:.4f} deg, tilted {:.3f} deg\n",
             sheets.WorstOffMm(lights), sheets.WorstDeg(sheets.flat, lights),
             sheets.WorstDeg(sheets.tilted, lights));
  EXPECT_GT(sheets.WorstOffMm(lights), 15.0);  // worse than the ruler
  EXPECT_LT(sheets.WorstDeg(sheets.flat, lights), 0.05);
  EXPECT_GT(sheets.WorstDeg(sheets.tilted, lights), 0.3);
}

// A map that is linear over the blocks must not be bent at the border, where errors show.
TEST(SeedProcedure, SmoothingKeepsALinearMap) {
  constexpr int kColumns = 7;
  constexpr int kRows = 5;
  std::vector<SheetSample> samples;
  std::vector<int> blocks;
  const Eigen::Vector3d far_away(0, 0, 1e9);
  for (int block = 0; block < kColumns * kRows; ++block) {
    const double x = block % kColumns;
    const double y = static_cast<double>(block / kColumns);
    SheetSample sample;
    sample.point_mm = {x, y, 0.0};
    sample.radiance_rgb.setConstant(10.0 + 2.0 * x - y);
    samples.push_back(sample);
    blocks.push_back(block);
  }
  const SeedLight light = CalibrateBySeedProcedure(samples, blocks, kColumns, kRows, far_away,
                                                   {.albedo = 0.5, .most_rounds = 1})
                              .value();
  for (size_t i = 0; i < samples.size(); ++i) {
    EXPECT_NEAR(light.intensity_rgb[i].y(), samples[i].radiance_rgb.y() / 0.5, 1e-4) << i;
  }
}

TEST(SeedProcedure, OptionsAreChecked) {
  const TwoSheets sheets(0.0);
  const auto message = [&](const SeedProcedureOptions& options) {
    return CalibrateBySeedProcedure(sheets.flat[0], sheets.blocks[0], 64, 42, sheets.ruler_mm[0],
                                    options)
        .error()
        .message;
  };
  EXPECT_THAT(message({.albedo = 0.0}), HasSubstr("albedo = 0; need 0 < albedo <= 1"));
  EXPECT_THAT(message({.smoothing_passes = -1}), HasSubstr("smoothing_passes = -1"));
  EXPECT_THAT(message({.most_rounds = 0}), HasSubstr("most_rounds = 0; need 1 or more"));
  EXPECT_THAT(message({.least_turn_rad = 0.0}), HasSubstr("least_turn_rad = 0"));
  EXPECT_THAT(CalibrateBySeedProcedure({}, {}, 1, 1, {0, 0, 1}).error().message,
              HasSubstr("no samples"));
}

}  // namespace
}  // namespace sateen::seed_procedure_test
