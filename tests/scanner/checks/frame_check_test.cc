#include <gmock/gmock.h>

#include <filesystem>

#include "imaging/dng.h"
#include "scanner/checks/capture_check.h"
#include "tests/scanner/checks/simulated_faults.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::frame_check_test {
namespace {

using testing::CalibratedRig;
using testing::Fabric;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kNudgePx;
using testing::LookAt;
using testing::Mixed;
using testing::SessionLooks;
using ::testing::SizeIs;

class CheckCaptureCase : public ::testing::Test {
 protected:
  CheckCaptureCase() : looks_(fabric_, 3) {}
  CaptureCheck Check(const FrameCheckOptions& options = {}) {
    return CheckCapture(rig_, looks_, options);
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

// A channel whose cable goes to another light's LED.
TEST_F(CheckCaptureCase, FindsALightThatIsLitTwice) {
  looks_.lit[2] = LookAt(fabric_.lit[6], 1);
  const CaptureCheck check = Check();
  ASSERT_THAT(check.faults, SizeIs(1));
  EXPECT_THAT(check.faults[0].text,
              HasSubstr("the frame of light 'led-2' is lit from the position of light 'led-6'"));
}

TEST_F(CheckCaptureCase, SaysWhichFrameMovedAndCameBack) {
  looks_.lit[4] = LookAt(fabric_.nudged[4], 1);
  const CaptureCheck check = Check();
  ASSERT_THAT(check.faults, SizeIs(1));
  EXPECT_THAT(check.faults[0].text, HasSubstr("in the frames of lights 'led-4'"));
}

TEST(RecordShifts, WritesWhatIsSignificantToFramesOfTheStack) {
  const Rig rig = CalibratedRig();
  Session session;
  for (const size_t k : {0U, 1U, 2U}) {
    session.frames.push_back({.role = FrameRole::kLit, .light = rig.lights[k].name});
  }
  session.frames.push_back({.role = FrameRole::kRepeat, .light = rig.lights[0].name});
  session.frames.push_back({.role = FrameRole::kDark});
  CaptureCheck check;
  check.shifts.assign(rig.lights.size() + 1, {.px = {0.4004, -0.3}, .sd_px = 0.02});
  check.shifts[0] = {.sd_px = 0.0};
  check.shifts[2].sd_px = 0.3;
  RecordShifts(check, rig, session);
  EXPECT_EQ(session.frames[1].shift_px, Eigen::Vector2d(0.4, -0.3));
  for (const size_t frame : {0U, 2U, 3U, 4U}) {
    EXPECT_FALSE(session.frames[frame].shift_px) << frame;
  }
  RecordShifts({}, rig, session);
  EXPECT_FALSE(session.frames[1].shift_px);
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
  rig_.calibration = {};
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
    const Image<uint16_t> mosaic = *Expose(sensor, radiance, HashOf(5, seen_++));
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
    seen_ = 0;
    CaptureLooks looks;
    for (size_t k = 0; k < lit.size(); ++k) {
      looks.lit.push_back(Look(lit[k], fmt::format("{}", k), FrameRole::kLit));
    }
    looks.dark_first = Look(dark, "dark", FrameRole::kDark);
    looks.dark_last = looks.dark_first;
    looks.repeat = Look(repeat, "again", FrameRole::kRepeat);
    return CheckCapture(rig_, looks, {});
  }
  testing::TempFolder temp_;
  Rig rig_ = CalibratedRig();
  uint64_t seen_ = 0;  // frames, each with noise of its own
};

TEST_F(CheckRawFrames, FindTheSame) {
  const Fabric fabric("knit", rig_, kNudgePx);
  EXPECT_EQ(testing::WordsOf(Check(fabric.lit, fabric.lit[0], fabric.dark)), " nothing");
  std::vector<Image3> nudged = fabric.lit;
  std::copy(fabric.nudged.begin() + 6, fabric.nudged.end(), nudged.begin() + 6);
  EXPECT_THAT(testing::WordsOf(Check(nudged, fabric.nudged[0], fabric.dark)),
              ::testing::AllOf(HasSubstr("has moved by 3."),
                               HasSubstr("from the frame of light 'led-6' on")));
  std::vector<Image3> shaded = fabric.lit;
  shaded[4] = testing::PassersShadow(3).On(shaded[4]);
  EXPECT_THAT(testing::WordsOf(Check(shaded, fabric.lit[0], fabric.dark)),
              HasSubstr("a shadow lies on the frame of light 'led-4'"));
}

TEST(FrameCheckOptions, NamesWhatIsOutOfRange) {
  FrameCheckOptions options;
  EXPECT_TRUE(options.Validate());
  options.max_shift_px = 0.0;
  EXPECT_THAT(options.Validate().error(),
              testing::IsError(ErrorCode::kInvalidArgument, "max_shift_px = 0"));
}

}  // namespace
}  // namespace sateen::frame_check_test
