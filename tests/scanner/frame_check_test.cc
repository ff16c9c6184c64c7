#include "scanner/frame_check.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <functional>

#include "imaging/dng.h"
#include "tests/scanner/captures.h"
#include "tests/scanner/simulated_looks.h"

// Simulated sessions, with what goes wrong in a capture: how often each is found.
namespace sateen {
namespace {

using testing::CalibratedRig;
using testing::Fabric;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kLookLights;
using testing::LookAt;
using testing::Mixed;
using testing::SessionLooks;
using ::testing::SizeIs;

constexpr int kSeeds = 25;  // of each fabric
constexpr double kRulerMm = 30.0;
const Eigen::Vector2d kNudgePx(-1.8, 2.4);  // 3 px

struct Rate {
  const char* name;
  // Does the damage and says what must be found: exactly these lights by this kind of fault.
  std::function<CaptureFault(const Fabric&, SessionLooks&, uint64_t)> damage;
  bool needs_calibration = false;  // levels are not known of a rig by the ruler
  int found = 0;
  int sessions = 0;
};

size_t AnyLight(uint64_t seed) { return HashOf(seed, 200) % kLookLights; }

std::vector<Rate> Rates() {
  return {
      {"two lights swapped",
       [](const Fabric&, SessionLooks& looks, uint64_t seed) {
         const size_t a = AnyLight(seed);
         const size_t b = (a + 1 + HashOf(seed, 201) % (kLookLights - 1)) % kLookLights;
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
       },
       true},
      {"two lights on",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] =
             LookAt(Mixed(fabric.lit[k], 1.0F, fabric.lit[(k + 3) % kLookLights], 1.0F), seed);
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
         looks.Nudge(fabric, 1 + HashOf(seed, 202) % kLookLights, seed);
         return CaptureFault{CaptureFaultKind::kMoved, {}, ""};
       }},
      {"shadow of a passer-by",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] = LookAt(testing::PassersShadow(HashOf(seed, 203)).On(fabric.lit[k]), seed);
         return CaptureFault{CaptureFaultKind::kShaded, {k}, ""};
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

std::string WordsOf(const CaptureCheck& check) {
  std::string words;
  for (const CaptureFault& fault : check.faults) {
    words += "\n  " + fault.text;
  }
  return words.empty() ? " nothing" : words;
}

// What the clean sessions show.
struct Clean {
  int sessions = 0;
  int false_alarms = 0;
  double level = 0.0;
  double shift_px = 0.0;

  void Add(const std::string& fabric, const CaptureCheck& check) {
    ++sessions;
    false_alarms += check.faults.empty() ? 0 : 1;
    if (!check.faults.empty()) {
      fmt::print("{}, clean:{}\n", fabric, WordsOf(check));
    }
    for (const double one : check.levels) {
      level = std::max(level, std::abs(one - 1.0));
    }
    for (const Shift& shift : check.shifts) {
      shift_px = std::max(shift_px, shift.px.norm());
    }
  }
};

// The bars: each fault is found in 99 of 100 sessions, and is the only one; 1 false alarm in 200.
TEST(CheckCapture, FindsWhatGoesWrongAndNothingElse) {
  const Rig calibrated = CalibratedRig();
  std::vector<Rate> rates = Rates();
  Clean clean;
  double nudge_error = 0.0;
  for (const char* name :
       {"print", "twill", "plain", "knit", "rib", "satin", "velvet", "ripples"}) {
    const Fabric fabric(name, calibrated, kNudgePx);
    for (int i = 0; i < kSeeds; ++i) {
      const uint64_t seed = HashOf(1, static_cast<uint64_t>(clean.sessions));
      const Rig rig = i / 2 % 2 == 0 ? calibrated : testing::RoughRig(calibrated, kRulerMm, seed);
      const SessionLooks looks(fabric, seed);
      clean.Add(name, CheckCapture(rig, looks.Looks(), {}));
      if (i % 2 == 1) {
        continue;  // 100 sessions with each fault
      }
      for (Rate& rate : rates) {
        SessionLooks damaged = looks;
        const CaptureFault wanted = rate.damage(fabric, damaged, seed);
        const CaptureCheck found =
            CheckCapture(rate.needs_calibration ? calibrated : rig, damaged.Looks(), {});
        rate.found += Found(found, wanted) ? 1 : 0;
        ++rate.sessions;
        if (!Found(found, wanted)) {
          fmt::print("{}, {} (seed {}):{}\n", name, rate.name, seed, WordsOf(found));
        }
        if (wanted.kind == CaptureFaultKind::kMoved && !found.shifts.empty()) {
          nudge_error = std::max(nudge_error, (found.shifts.back().px - kNudgePx).norm());
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
             "false alarms in", clean.false_alarms, clean.sessions, 100.0 * clean.level,
             clean.shift_px);
  fmt::print("{:24} within {:.2f} px\n", "the nudge is measured", nudge_error);
  EXPECT_LE(clean.false_alarms, clean.sessions / 200);
  EXPECT_LT(nudge_error, 0.5);
}

class CheckCaptureCase : public ::testing::Test {
 protected:
  CheckCaptureCase() : looks_(fabric_, 3) {}
  CaptureCheck Check(const FrameCheckOptions& options = {}) {
    return CheckCapture(rig_, looks_.Looks(), options);
  }
  Rig rig_ = CalibratedRig();
  inline static const Fabric fabric_ = Fabric("print", CalibratedRig(), kNudgePx);  // for all cases
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

// The same through files: RAW as the camera's, read and checked one by one, then together.
class CheckRawFrames : public ::testing::Test {
 protected:
  FrameLook Look(const Image3& radiance, const std::string& name, FrameRole role) {
    Sensor sensor = *SensorNamed("nikon-d5100");
    sensor.full_scale = 1.5;
    const Image<uint16_t> mosaic = *Expose(sensor, radiance, HashOf(5, looks_.size()));
    const std::filesystem::path path = temp_.Path() / (name + ".dng");
    EXPECT_TRUE(WriteDng(path, mosaic,
                         {.cfa = sensor.cfa,
                          .black = sensor.black_dn,
                          .white = sensor.white_dn,
                          .exposure_s = 0.1}));
    const Result<FrameLook> look =
        CheckFrame({.path = path, .exposure = 0.1}, rig_, {.exposure_s = 0.1}, role, {});
    EXPECT_TRUE(look) << look.error().message;
    return look.value_or(FrameLook());
  }
  CaptureCheck Check(const std::vector<Image3>& lit, const Image3& repeat, const Image3& dark) {
    looks_.clear();
    for (size_t k = 0; k < lit.size(); ++k) {
      looks_.push_back(Look(lit[k], fmt::format("{}", k), FrameRole::kLit));
    }
    const FrameLook dark_look = Look(dark, "dark", FrameRole::kDark);
    const FrameLook repeat_look = Look(repeat, "again", FrameRole::kRepeat);
    CaptureLooks looks{.dark_first = &dark_look, .dark_last = &dark_look, .repeat = &repeat_look};
    for (const FrameLook& look : looks_) {
      looks.lit.push_back(&look);
    }
    return CheckCapture(rig_, looks, {});
  }
  testing::TempFolder temp_;
  Rig rig_ = CalibratedRig();
  std::vector<FrameLook> looks_;
};

TEST_F(CheckRawFrames, FindTheSame) {
  const Fabric fabric("knit", rig_, kNudgePx);
  EXPECT_EQ(WordsOf(Check(fabric.lit, fabric.lit[0], fabric.dark)), " nothing");
  std::vector<Image3> nudged = fabric.lit;
  std::copy(fabric.nudged.begin() + 6, fabric.nudged.end(), nudged.begin() + 6);
  EXPECT_THAT(WordsOf(Check(nudged, fabric.nudged[0], fabric.dark)),
              ::testing::AllOf(HasSubstr("has moved by 3."),
                               HasSubstr("from the frame of light 'led-6' on")));
  std::vector<Image3> shaded = fabric.lit;
  shaded[4] = testing::PassersShadow(3).On(shaded[4]);
  EXPECT_THAT(WordsOf(Check(shaded, fabric.lit[0], fabric.dark)),
              HasSubstr("a shadow lies on the frame of light 'led-4'"));
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
