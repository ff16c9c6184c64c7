#include "calibration/check/light_check.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calibration/synthetic_readings.h"

namespace sateen::light_check_test {
namespace {

using sateen::testing::CalibratedRig;
using sateen::testing::ReadingsGrid;
using sateen::testing::ReadingsOf;
using sateen::testing::SamplesOn;
using sateen::testing::SyntheticCamera;
using ::testing::HasSubstr;

constexpr int kColumns = ReadingsGrid().columns;
constexpr int kRows = ReadingsGrid().rows;

// Rig as it was calibrated, and sheets as it sees them today.
struct Today {
  Rig rig;
  std::vector<SheetReadings> sheets;
  std::vector<FrameFault> faults;
};

Today See(const Rig& rig, const Rig& actual, int sheets, uint64_t seed) {
  return {rig, ReadingsOf(rig, actual, sheets, seed), std::vector<FrameFault>(rig.lights.size())};
}

RigCheck Check(const Today& today, const LightCheckOptions& options = {}) {
  const Result<RigCheck> check = CheckRig(today.rig, today.sheets, today.faults, options);
  EXPECT_TRUE(check) << check.error().message;
  return check.value_or(RigCheck());
}

std::vector<LightVerdict> VerdictsOf(const RigCheck& check) {
  std::vector<LightVerdict> verdicts;
  for (const LightCheck& light : check.lights) {
    verdicts.push_back(light.verdict);
  }
  return verdicts;
}

// All hold but one.
std::vector<LightVerdict> Only(size_t light, LightVerdict verdict) {
  std::vector<LightVerdict> verdicts(10, LightVerdict::kHolds);
  verdicts[light] = verdict;
  return verdicts;
}

TEST(LightCheck, CleanSheetsRaiseNoAlarm) {
  int alarms = 0;
  int explained = 0;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    const LightModel model = seed % 2 == 0 ? LightModel::kLed : LightModel::kNear;
    // From a phone's frame to a D5100's, one flat sheet or with tilts.
    const Rig rig =
        CalibratedRig(model, seed % 3 == 0 ? ImageSize{640, 424} : ImageSize{4928, 3264});
    const RigCheck check = Check(See(rig, rig, seed % 5 == 0 ? 3 : 1, seed));
    alarms += check.holds ? 0 : 1;
    for (const LightChange& light : check.change.lights) {
      explained += light.moved_mm.isZero() && light.turned_rad.isZero() ? 0 : 1;
    }
    explained += check.change.camera.isZero() ? 0 : 1;
  }
  fmt::print("clean sheets: {} false alarms in 100, {} needless explanations\n", alarms, explained);
  EXPECT_EQ(alarms, 0);
  EXPECT_EQ(explained, 0);
}

TEST(LightCheck, NamesADimLight) {
  for (const double share : {0.8, 0.97}) {
    const Rig rig = CalibratedRig();
    Rig actual = rig;
    actual.lights[3].flux_rgb *= share;
    const RigCheck check = Check(See(rig, actual, 1, 7));

    EXPECT_FALSE(check.holds);
    EXPECT_EQ(VerdictsOf(check), Only(3, LightVerdict::kDim));
    fmt::print("flux of {}: {:.4f} +- {:.4f}\n", share, check.lights[3].flux_ratio[1],
               check.lights[3].flux_sd[1]);
    EXPECT_NEAR(check.lights[3].flux_ratio[1], share, 5.0 * check.lights[3].flux_sd[1] + 1e-4);
    EXPECT_LT(check.lights[3].flux_sd[1], 1e-3);
  }
}

TEST(LightCheck, NamesABlueThatFades) {
  const Rig rig = CalibratedRig();
  Rig actual = rig;
  actual.lights[6].flux_rgb[2] *= 0.95;
  const RigCheck check = Check(See(rig, actual, 1, 8));

  EXPECT_EQ(VerdictsOf(check), Only(6, LightVerdict::kDim));
  EXPECT_NEAR(check.lights[6].flux_ratio[2], 0.95, 1e-3);
  EXPECT_NEAR(check.lights[6].flux_ratio[0], 1.0, 1e-3);
}

TEST(LightCheck, NamesABumpedLampAndByHowMuch) {
  for (const LightModel model : {LightModel::kNear, LightModel::kLed}) {
    const Rig rig = CalibratedRig(model);
    Rig actual = rig;
    actual.lights[7].position_mm += Eigen::Vector3d(2.0, -1.0, 2.0);  // 3 mm
    const RigCheck check = Check(See(rig, actual, 1, 9));

    EXPECT_EQ(VerdictsOf(check), Only(7, LightVerdict::kMoved));
    const LightCheck& light = check.lights[7];
    fmt::print(
        "moved 2, -1, 2 mm: {:.2f} {:.2f} {:.2f} +- {:.2f} {:.2f} {:.2f}, {:.3f} deg, flux "
        "{:.4f}\n",
        light.moved_mm[0], light.moved_mm[1], light.moved_mm[2], light.moved_sd_mm[0],
        light.moved_sd_mm[1], light.moved_sd_mm[2], light.direction_deg, light.flux_ratio[1]);
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_NEAR(light.moved_mm[i], (Eigen::Vector3d(2.0, -1.0, 2.0)[i]),
                  4.0 * light.moved_sd_mm[i]);
    }
    EXPECT_LT(light.moved_sd_mm.norm(), 0.5);
    EXPECT_TRUE(check.camera.moved_mm.isZero());
  }
}

// Also one whose lens has a gain of its own over the table.
TEST(LightCheck, NamesATurnedLed) {
  for (const LightModel model : {LightModel::kLed, LightModel::kLedField}) {
    const Rig rig = CalibratedRig(model);
    Rig actual = rig;
    actual.lights[2].axis =
        Eigen::AngleAxisd(6.0 * kRadPerDeg, Eigen::Vector3d::UnitX()) * rig.lights[2].axis;
    const RigCheck check = Check(See(rig, actual, 3, 10));

    EXPECT_EQ(VerdictsOf(check), Only(2, LightVerdict::kTurned));
    const double turned_deg = std::acos(actual.lights[2].axis.dot(rig.lights[2].axis)) / kRadPerDeg;
    fmt::print("turned by {:.3f} degrees: {:.3f} +- {:.3f}\n", turned_deg,
               check.lights[2].turned_deg, check.lights[2].turned_sd_deg);
    EXPECT_NEAR(check.lights[2].turned_deg, turned_deg, 5.0 * check.lights[2].turned_sd_deg);
  }
}

TEST(LightCheck, NamesDeadAndSaturatedLights) {
  const Rig rig = CalibratedRig();
  Today today = See(rig, rig, 1, 11);
  today.sheets[0].samples[4].clear();
  today.sheets[0].blocks[4].clear();
  today.faults[4] = FrameFault::kDark;
  EXPECT_EQ(VerdictsOf(Check(today)), Only(4, LightVerdict::kDark));
  today.faults[4] = FrameFault::kSaturated;
  const RigCheck check = Check(today);
  EXPECT_EQ(VerdictsOf(check), Only(4, LightVerdict::kSaturated));
  EXPECT_FALSE(check.holds);
}

TEST(LightCheck, NamesSwappedFrames) {
  const Rig rig = CalibratedRig();
  Today today = See(rig, rig, 1, 12);
  std::swap(today.sheets[0].samples[3], today.sheets[0].samples[4]);
  const RigCheck check = Check(today);

  std::vector<LightVerdict> expected(10, LightVerdict::kHolds);
  expected[3] = expected[4] = LightVerdict::kElsewhere;
  EXPECT_EQ(VerdictsOf(check), expected);
  EXPECT_EQ(check.lights[3].lit_from, 4U);
  EXPECT_EQ(check.lights[4].lit_from, 3U);
}

TEST(LightCheck, NamesAMovedCameraAndNotTheLights) {
  for (const Eigen::Vector3d& by : {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d(-0.6, 0.8, 0.0),
                                    Eigen::Vector3d(0.0, 0.0, 4.0)}) {
    const Rig rig = CalibratedRig();
    Rig actual = rig;
    actual.camera->table_from_camera.pretranslate(by);
    const RigCheck check = Check(See(rig, actual, 1, 13));

    EXPECT_EQ(VerdictsOf(check), std::vector<LightVerdict>(10, LightVerdict::kHolds));
    EXPECT_TRUE(check.camera.has_moved);
    EXPECT_FALSE(check.holds);
    const CameraCheck& camera = check.camera;
    fmt::print(
        "camera: {:.3f} {:.3f} {:.3f} +- {:.3f} {:.3f} {:.3f} mm, {:.3f} +- {:.3f} degrees\n",
        camera.moved_mm[0], camera.moved_mm[1], camera.moved_mm[2], camera.moved_sd_mm[0],
        camera.moved_sd_mm[1], camera.moved_sd_mm[2], camera.turned_deg, camera.turned_sd_deg);
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_NEAR(camera.moved_mm[i], by[i], 5.0 * camera.moved_sd_mm[i]);
    }
  }
}

TEST(LightCheck, NamesAMovedCameraAndABumpedLamp) {
  const Rig rig = CalibratedRig();
  Rig actual = rig;
  actual.camera->table_from_camera.pretranslate(Eigen::Vector3d(2.0, 0.0, 0.0));
  actual.lights[1].position_mm += Eigen::Vector3d(0.0, 5.0, 0.0);
  const RigCheck check = Check(See(rig, actual, 1, 14));

  EXPECT_EQ(VerdictsOf(check), Only(1, LightVerdict::kMoved));
  EXPECT_TRUE(check.camera.has_moved);
}

TEST(LightCheck, PaperAndExposureAreNoLightsFault) {
  const Rig rig = CalibratedRig();
  Rig actual = rig;
  for (Light& light : actual.lights) {
    light.flux_rgb *= 0.95;
  }
  const RigCheck check = Check(See(rig, actual, 1, 15));

  EXPECT_EQ(VerdictsOf(check), std::vector<LightVerdict>(10, LightVerdict::kHolds));
  EXPECT_TRUE(check.is_common_flux_off);
  EXPECT_NEAR(check.common_flux[0], 0.95, 1e-3);
}

// Multiplies every block of the first sheet by `change` of its place in [-1, 1]^2 and of the light.
template <typename Change>
void Spoil(Today& today, const Change& change) {
  for (size_t k = 0; k < today.rig.lights.size(); ++k) {
    for (size_t j = 0; j < today.sheets[0].samples[k].size(); ++j) {
      SheetSample& sample = today.sheets[0].samples[k][j];
      const Eigen::Vector3d l = IncidentAt(today.rig.lights[k], sample.point_mm).l;
      sample.radiance_rgb *= change(sample.point_mm.x() / 150.0, sample.point_mm.y() / 100.0, l);
    }
  }
}

TEST(LightCheck, ATiltedSheetIsNoLightsFault) {
  const Rig rig = CalibratedRig();
  Today today = See(rig, rig, 1, 16);
  const SyntheticCamera camera{.camera = *rig.camera, .columns = kColumns, .rows = kRows};
  const double slope = 1.0 * kRadPerDeg;
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    const std::vector<SheetSample> tilted =
        SamplesOn({{-std::sin(slope), 0.0, std::cos(slope)}}, camera, rig.lights[k], 160 + k);
    for (size_t j = 0; j < tilted.size(); ++j) {
      today.sheets[0].samples[k][j].radiance_rgb = tilted[j].radiance_rgb;
    }
  }
  const RigCheck check = Check(today);

  EXPECT_EQ(VerdictsOf(check), std::vector<LightVerdict>(10, LightVerdict::kHolds));
  EXPECT_FALSE(check.camera.has_moved);
  EXPECT_TRUE(check.sheets[0].is_off);
  fmt::print("a sheet that tilts by 1 degree, 2.6 mm at its edge: {:.4f} degrees, {:.3f} mm\n",
             check.sheets[0].slope_deg, check.sheets[0].height_mm);
  EXPECT_NEAR(check.sheets[0].slope_deg, 1.0, 0.01);
  EXPECT_NEAR(check.sheets[0].height_mm, 150.0 * std::tan(slope), 0.1);
}

TEST(LightCheck, SpotsAreCountedAndHurtNoLight) {
  const Rig rig = CalibratedRig();
  Today today = See(rig, rig, 1, 17);
  Spoil(today, [&](double x, double y, const Eigen::Vector3d&) {
    return std::abs(x) < 0.2 && std::abs(y) < 0.2 ? 0.9 : 1.0;
  });
  const RigCheck check = Check(today);

  EXPECT_EQ(VerdictsOf(check), std::vector<LightVerdict>(10, LightVerdict::kHolds));
  EXPECT_NEAR(check.sheets[0].spots, 0.04, 0.015);
  EXPECT_EQ(check.sheets[0].folds, 0.0);
  EXPECT_TRUE(check.holds);  // up to a tenth of the sheet
}

TEST(LightCheck, AFoldIsCountedAndHurtsNoLight) {
  const Rig rig = CalibratedRig();
  Today today = See(rig, rig, 1, 18);
  Spoil(today, [&](double x, double, const Eigen::Vector3d& l) {
    return std::abs(x - 0.3) < 0.05 ? 1.0 - 0.05 * l.x() / l.z() : 1.0;
  });
  const RigCheck check = Check(today);

  EXPECT_EQ(VerdictsOf(check), std::vector<LightVerdict>(10, LightVerdict::kHolds));
  EXPECT_GT(check.sheets[0].folds, 0.02);
  EXPECT_NEAR(check.sheets[0].steepest_deg, std::atan(0.05) / kRadPerDeg, 0.1);
  EXPECT_EQ(check.sheets[0].spots, 0.0);
}

TEST(LightCheck, AFewBlindPixelsSayThatTheyAreUnclear) {
  const Rig rig = CalibratedRig(LightModel::kNear, {320, 212});
  const RigCheck check = Check(See(rig, rig, 1, 19));

  EXPECT_TRUE(check.holds);
  EXPECT_TRUE(check.lights[0].is_unclear);
  EXPECT_FALSE(Check(See(CalibratedRig(), CalibratedRig(), 3, 20)).lights[0].is_unclear);
}

TEST(LightCheck, ErrorsSayWhatToDo) {
  const Rig rig = CalibratedRig();
  const Today today = See(rig, rig, 1, 21);
  const auto message = [&](const Rig& with, const std::vector<SheetReadings>& sheets,
                           const LightCheckOptions& options) {
    return CheckRig(with, sheets, today.faults, options).error().message;
  };
  Rig blind = rig;
  blind.camera.reset();
  EXPECT_THAT(message(blind, today.sheets, {}), HasSubstr("no camera"));
  Rig distant = rig;
  distant.lights[2].model = LightModel::kDistant;
  EXPECT_THAT(message(distant, today.sheets, {}), HasSubstr("'led-2' is distant"));
  EXPECT_THAT(message(rig, {}, {}), HasSubstr("need at least one"));
  EXPECT_THAT(message(rig, today.sheets, {.albedo = 0.0}), HasSubstr("albedo = 0; need 0 <"));
  EXPECT_THAT(message(rig, today.sheets, {.max_flux_percent = 100.0}),
              HasSubstr("max_flux_percent = 100; need 0 < max_flux_percent < 100"));
  std::vector<SheetReadings> empty = today.sheets;
  for (std::vector<SheetSample>& samples : empty[0].samples) {
    samples.clear();
  }
  EXPECT_THAT(message(rig, empty, {}), HasSubstr("did the lights come on"));
}

}  // namespace
}  // namespace sateen::light_check_test
