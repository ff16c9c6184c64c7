#include "scanner/frame_check.h"

#include <gmock/gmock.h>

#include <functional>

#include "simulation/random.h"
#include "simulation/render.h"
#include "simulation/rigs.h"
#include "simulation/sensor.h"
#include "simulation/weave.h"
#include "tests/scanner/captures.h"

// Simulated sessions, with what goes wrong in a capture: how often each is found.
namespace sateen {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr ImageSize kPx = {160, 120};
constexpr BlockGrid kGrid = {.columns = 24, .rows = 16};
constexpr int kSeeds = 50;  // of each fabric
constexpr int kLights = 10;
const Eigen::Vector2d kNudgePx(-1.8, 2.4);  // 3 px

Rig CalibratedRig() {
  Rig rig = RingRig(kPx, LightModel::kLed);
  rig.calibration_json = R"({"lights": {}})";
  return rig;
}

Scene SceneOf(const std::string& fabric, const Rig& rig) {
  Scene scene;
  scene.rig = rig;
  const Material wavy{.albedo = WavyAlbedo{.min = 0.2, .max = 0.7, .period_mm = 19.0}};
  if (fabric == "print") {  // flat cloth, printed
    scene.surface = *MakePlane(0.0, 0.0);
    scene.materials = {{.albedo = PatchesAlbedo{.values = {0.2, 0.9, 0.4, 0.7}}}};
    return scene;
  }
  scene.surface = *MakeWeave({.pattern = *WeavePatternNamed(fabric), .pitch_mm = 9.0});
  scene.materials.assign(scene.surface->Parts().size(), wavy);
  return scene;
}

// The frames of one fabric without noise.
struct Fabric {
  explicit Fabric(const std::string& name, const Rig& rig) {
    Scene scene = SceneOf(name, rig);
    scene.illumination.shadows = Shadows::kCast;
    scene.lens.psf_sigma_px = 0.8;  // or yarns of a few pixels would alias
    SceneRenderer renderer = *SceneRenderer::Create(scene);
    for (size_t k = 0; k < kLights; ++k) {
      lit.push_back(renderer.Render(k)->radiance);
    }
    dark = renderer.Render(std::nullopt)->radiance;
    scene.lens.bump_from = rig.lights[0].name;
    scene.lens.bump_px = kNudgePx;
    SceneRenderer bumped = *SceneRenderer::Create(scene);
    nudged = bumped.Render(0)->radiance;
  }
  std::vector<Image3> lit;
  Image3 dark;
  Image3 nudged;  // the first light
};

Image3 Mixed(const Image3& a, float by, const Image3& b, float times) {
  Image3 mixed = a;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < mixed[c].pixels.size(); ++p) {
      mixed[c].pixels[p] = by * a[c].pixels[p] + times * b[c].pixels[p];
    }
  }
  return mixed;
}

// What a frame of the radiance looks like to the checks: noise of a sensor at a quarter of its range.
FrameLook LookAt(const Image3& radiance, uint64_t seed) {
  Sensor sensor = *SensorNamed("nikon-d5100");
  sensor.full_scale = 1.5;
  const Image<uint16_t> mosaic = *Expose(sensor, radiance, seed, {.threads = 1});
  FrameLook look{.means = {.size_px = kPx, .grid = kGrid},
                 .middle = Image<float>(kPx.width / 2, kPx.height / 2)};
  look.means.blocks.resize(static_cast<size_t>(kGrid.columns) * static_cast<size_t>(kGrid.rows));
  const double range = sensor.white_dn - sensor.black_dn;
  for (int y = 0; y < kPx.height; ++y) {
    for (int x = 0; x < kPx.width; ++x) {
      const double value = (mosaic.At(x, y) - sensor.black_dn) / range;
      const auto colour =
          static_cast<Eigen::Index>(sensor.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
      const int block = y * kGrid.rows / kPx.height * kGrid.columns + x * kGrid.columns / kPx.width;
      look.means.blocks[static_cast<size_t>(block)].radiance_rgb[colour] += value;
      look.middle.At(x / 2, y / 2) += static_cast<float>(value);
    }
  }
  return look;
}

// The looks of one session; what a fault changes is put in place of it.
struct SessionLooks {
  SessionLooks(const Fabric& fabric, uint64_t seed) {
    for (size_t k = 0; k < kLights; ++k) {
      lit.push_back(LookAt(fabric.lit[k], HashOf(seed, k)));
    }
    dark_first = LookAt(fabric.dark, HashOf(seed, 100));
    dark_last = LookAt(fabric.dark, HashOf(seed, 101));
    repeat = LookAt(fabric.lit[0], HashOf(seed, 102));
  }
  [[nodiscard]] CaptureLooks Looks() const {
    CaptureLooks looks{.dark_first = &dark_first, .dark_last = &dark_last, .repeat = &repeat};
    for (const FrameLook& look : lit) {
      looks.lit.push_back(&look);
    }
    return looks;
  }
  std::vector<FrameLook> lit;
  FrameLook dark_first;
  FrameLook dark_last;
  FrameLook repeat;
};

struct Rate {
  const char* name;
  // Does the damage and says what must be found: exactly these lights by this kind of fault.
  std::function<CaptureFault(const Fabric&, SessionLooks&, uint64_t)> damage;
  int found = 0;
  int sessions = 0;
};

size_t AnyLight(uint64_t seed) { return HashOf(seed, 200) % kLights; }

std::vector<Rate> Rates() {
  return {
      {"two lights swapped",
       [](const Fabric&, SessionLooks& looks, uint64_t seed) {
         const size_t a = AnyLight(seed);
         const size_t b = (a + 1 + HashOf(seed, 201) % (kLights - 1)) % kLights;
         std::swap(looks.lit[a], looks.lit[b]);
         return CaptureFault{CaptureFaultKind::kOtherLight, {std::min(a, b), std::max(a, b)}, ""};
       }},
      {"dead LED",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.lit[AnyLight(seed)] = LookAt(fabric.dark, seed);
         return CaptureFault{CaptureFaultKind::kDark, {AnyLight(seed)}, ""};
       }},
      {"light at 80 %",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] = LookAt(Mixed(fabric.lit[k], 0.8F, fabric.dark, 0.0F), seed);
         return CaptureFault{CaptureFaultKind::kLevel, {k}, ""};
       }},
      {"two lights on",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] =
             LookAt(Mixed(fabric.lit[k], 1.0F, fabric.lit[(k + 3) % kLights], 1.0F), seed);
         return CaptureFault{CaptureFaultKind::kLevel, {k}, ""};
       }},
      {"ambient light on (5 %)",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.repeat = LookAt(Mixed(fabric.lit[0], 1.0F, fabric.lit[5], 0.05F), seed);
         looks.dark_last = LookAt(Mixed(fabric.dark, 1.0F, fabric.lit[5], 0.05F), seed);
         return CaptureFault{CaptureFaultKind::kAmbient, {}, ""};
       }},
      {"nudge of 3 px",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.repeat = LookAt(fabric.nudged, seed);
         return CaptureFault{CaptureFaultKind::kMoved, {}, ""};
       }},
  };
}

std::vector<size_t> LightsOf(const CaptureCheck& check, CaptureFaultKind kind) {
  std::vector<size_t> lights;
  for (const CaptureFault& fault : check.faults) {
    if (fault.kind == kind) {
      lights.insert(lights.end(), fault.lights.begin(), fault.lights.end());
    }
  }
  return lights;
}

bool Found(const CaptureCheck& check, const CaptureFault& wanted) {
  return std::ranges::any_of(check.faults,
                             [&](const CaptureFault& f) { return f.kind == wanted.kind; }) &&
         std::ranges::all_of(check.faults,
                             [&](const CaptureFault& f) { return f.kind == wanted.kind; }) &&
         LightsOf(check, wanted.kind) == wanted.lights;
}

// The bars: each fault is found in 99 of 100 sessions, and is the only one; 1 false alarm in 200.
TEST(CheckCapture, FindsWhatGoesWrongAndNothingElse) {
  const Rig rig = CalibratedRig();
  std::vector<Rate> rates = Rates();
  int false_alarms = 0;
  int clean = 0;
  double worst_level = 0.0;
  double worst_shift = 0.0;
  double nudge_error = 0.0;
  for (const char* name : {"print", "twill", "plain", "knit"}) {
    const Fabric fabric(name, rig);
    for (int i = 0; i < kSeeds; ++i) {
      const uint64_t seed = HashOf(1, static_cast<uint64_t>(clean++));
      const SessionLooks looks(fabric, seed);
      const CaptureCheck check = CheckCapture(rig, looks.Looks(), {});
      false_alarms += check.faults.empty() ? 0 : 1;
      if (!check.faults.empty() && i == 0) {
        ADD_FAILURE() << name << ": " << check.faults[0].text;
      }
      for (const double level : check.levels) {
        worst_level = std::max(worst_level, std::abs(level - 1.0));
      }
      worst_shift = std::max(worst_shift, check.shift ? check.shift->px.norm() : 99.0);
      if (i % 2 == 1) {
        continue;  // 100 sessions with each fault
      }
      for (Rate& rate : rates) {
        SessionLooks damaged = looks;
        const CaptureFault wanted = rate.damage(fabric, damaged, seed);
        const CaptureCheck found = CheckCapture(rig, damaged.Looks(), {});
        rate.found += Found(found, wanted) ? 1 : 0;
        ++rate.sessions;
        if (!Found(found, wanted) && i == 0) {
          ADD_FAILURE() << name << ", " << rate.name << ": "
                        << (found.faults.empty() ? "nothing" : found.faults[0].text) << ", shift "
                        << (found.shift ? found.shift->px.norm() : -1.0);
        }
        if (wanted.kind == CaptureFaultKind::kMoved && found.shift) {
          nudge_error = std::max(nudge_error, (found.shift->px - kNudgePx).norm());
        }
      }
    }
  }
  for (const Rate& rate : rates) {
    fmt::print("{:24} found, and nothing else, in {:3} of {} sessions\n", rate.name, rate.found,
               rate.sessions);
    EXPECT_GE(rate.found, 0.99 * rate.sessions) << rate.name;
  }
  fmt::print("{:24} {} of {} sessions; levels within {:.1f} %, shifts within {:.2f} px\n",
             "false alarms in", false_alarms, clean, 100.0 * worst_level, worst_shift);
  fmt::print("{:24} within {:.2f} px\n", "the nudge is measured", nudge_error);
  EXPECT_LE(false_alarms, clean / 200);
  EXPECT_LT(nudge_error, 1.0);
}

class CheckCaptureCase : public ::testing::Test {
 protected:
  CheckCaptureCase() : fabric_("print", rig_), looks_(fabric_, 3) {}
  CaptureCheck Check(const FrameCheckOptions& options = {}) {
    return CheckCapture(rig_, looks_.Looks(), options);
  }
  Rig rig_ = CalibratedRig();
  Fabric fabric_;
  SessionLooks looks_;
};

TEST_F(CheckCaptureCase, SaysWhichSecondLightWasOn) {
  looks_.lit[2] = LookAt(Mixed(fabric_.lit[2], 1.0F, fabric_.lit[6], 1.0F), 1);
  const CaptureCheck check = Check();
  ASSERT_THAT(check.faults, SizeIs(1));
  EXPECT_THAT(check.faults[0].text, HasSubstr("as if light 'led-6' were on too"));
}

TEST_F(CheckCaptureCase, MeasuresDriftAndAmbientLight) {
  looks_.repeat = LookAt(Mixed(fabric_.lit[0], 1.05F, fabric_.dark, 0.0F), 1);
  looks_.dark_last = LookAt(Mixed(fabric_.dark, 1.0F, fabric_.lit[5], 0.004F), 1);
  const CaptureCheck check = Check();
  EXPECT_NEAR(check.drift, 0.05, 0.003);
  EXPECT_NEAR(check.ambient, 0.004, 0.001);
  EXPECT_THAT(check.faults, IsEmpty());
  ASSERT_THAT(check.notes, SizeIs(1));
  EXPECT_THAT(check.notes[0], HasSubstr("+5.0 % brighter at the end"));
}

// A rig by the ruler does not know how bright its lights are.
TEST_F(CheckCaptureCase, DoesNotAskAnUncalibratedRigForLevels) {
  looks_.lit[4] = LookAt(Mixed(fabric_.lit[4], 0.8F, fabric_.dark, 0.0F), 1);
  EXPECT_THAT(Check().faults, SizeIs(1));
  rig_.calibration_json.clear();
  EXPECT_THAT(Check().faults, IsEmpty());
}

TEST_F(CheckCaptureCase, SaysWhatItCannotTell) {
  rig_.camera->has_pose = false;
  std::swap(looks_.lit[1], looks_.lit[2]);
  const CaptureCheck check = Check();
  EXPECT_THAT(check.faults, IsEmpty());
  ASSERT_THAT(check.notes, SizeIs(1));
  EXPECT_THAT(check.notes[0], HasSubstr("swapped lights are not found"));
}

TEST(ShiftBetween, TellsNothingWithoutTexture) {
  const Image<float> flat(80, 60, 0.5F);
  EXPECT_LT(ShiftBetween(flat, flat).peak, FrameCheckOptions().min_shift_peak);
  EXPECT_EQ(ShiftBetween(flat, Image<float>(80, 58)).peak, 0.0);
}

TEST(FrameCheckOptions, NamesWhatIsOutOfRange) {
  FrameCheckOptions options;
  EXPECT_TRUE(options.Validate());
  options.max_shift_px = 0.0;
  EXPECT_THAT(options.Validate().error(),
              testing::IsError(ErrorCode::kInvalidArgument, "max_shift_px is 0"));
}

}  // namespace
}  // namespace sateen
