#include "simulation/virtual_rig/rig_commands.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "imaging/raw.h"
#include "simulation/virtual_rig/camera/ptp_wire.h"
#include "tests/simulation/virtual_rig/board_talk.h"
#include "tests/simulation/virtual_rig/small_scene.h"
#include "tests/testing/files.h"

// Effects of each command on the rig, without its program: the loop is not run, and the board's
// time stands still.
namespace sateen::testing::rig_commands_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class RigCommandsTest : public ::testing::Test {
 protected:
  RigCommandsTest() : log_(14) {
    board_ = *VirtualBoard::Load(Firmware());
    port_.emplace(*VirtualPort::Open({}, std::nullopt));
    events_ = std::fopen((folder_.Path() / "events").c_str(), "we");
    loop_.emplace(*board_, *port_, RigLoopOptions{.events = events_, .light_log = &log_});
    commands_.emplace(*loop_, [this](const Error& e) { failures_.push_back(e.message); });
    log_.KnownUntil(LightLog::Time(std::chrono::hours(2)));
    scene_.emplace(SmallScene(), Sensor(), log_);
    camera_ =
        *VirtualCamera::Create({.source = [](const FrameRequest&) { return std::string("frame"); },
                                .asked = [this](int number) { commands_->CaptureAsked(number); }});
  }
  ~RigCommandsTest() override {
    camera_.reset();
    loop_.reset();
    std::fclose(events_);
  }

  void HasCamera() { commands_->HasCamera(*scene_, *camera_); }
  void Do(const std::string& line) {
    const Status done = commands_->Do(line);
    EXPECT_TRUE(done) << done.error().message;
  }
  std::string Refusal(const std::string& line) {
    const Status done = commands_->Do(line);
    EXPECT_FALSE(done) << line;
    EXPECT_EQ(done ? ErrorCode::kInvalidArgument : done.error().code, ErrorCode::kInvalidArgument);
    return done ? "" : done.error().message;
  }
  std::string ScheduleRefusal(const std::string& text) {
    const Status done = commands_->Schedule(text);
    EXPECT_FALSE(done) << text;
    return done ? "" : done.error().message;
  }
  // Red at (10, 10) of a frame with channel 3 on.
  double Red() {
    const LightLog::Time open(std::chrono::hours(1));
    log_.Changed(open - std::chrono::seconds(1), 3, 1.0);
    const auto bytes = scene_->Frame({.number = 1,
                                      .exposure_s = 0.02,
                                      .f_number = 8,
                                      .iso = 100,
                                      .begin = open,
                                      .end = open + std::chrono::milliseconds(20)});
    WriteText(folder_.Path() / "frame.dng", *bytes);
    return ReadRawMosaic(folder_.Path() / "frame.dng")->samples.At(10, 10);
  }
  static double RedOf(size_t light, double ambient = 1.0) {
    return SmallRadiance(light, 0, 10, 10) + ambient * kSmallAmbient;
  }
  uint16_t AskForCapture() { return camera_->Handle(ptp::kInitiateCapture, {}, "", 1).response; }
  std::vector<nlohmann::json> EventsSoFar() {
    std::ifstream file(folder_.Path() / "events");
    std::vector<nlohmann::json> events;
    for (std::string line; std::getline(file, line);) {
      events.push_back(nlohmann::json::parse(line));
    }
    return events;
  }

  const TempFolder folder_;
  std::vector<std::string> failures_;
  LightLog log_;
  std::unique_ptr<VirtualBoard> board_;
  std::optional<VirtualPort> port_;
  std::FILE* events_ = nullptr;
  std::optional<RigLoop> loop_;
  std::optional<RigCommands> commands_;
  std::optional<SceneCamera> scene_;
  std::unique_ptr<VirtualCamera> camera_;
};

constexpr double kOneReading = 1.0 / 65535.0;

TEST_F(RigCommandsTest, TheBoardIsUnpluggedAndPluggedInAgain) {
  Do("unplug");
  EXPECT_FALSE(board_->Plugged());
  EXPECT_FALSE(port_->Plugged());
  Do(" plug ");
  EXPECT_TRUE(board_->Plugged());
  EXPECT_TRUE(port_->Plugged());
  Do("reset");
  Do("brown-out 30");
  Do("flash");
}

TEST_F(RigCommandsTest, WhatIsNoCommandIsRefusedWithWhatIs) {
  EXPECT_THAT(Refusal("explode"), HasSubstr("'explode' is no command; need one of reset, unplug"));
  EXPECT_THAT(Refusal("nudge 1 2"), HasSubstr("or with --scene scene DIR"));
  HasCamera();
  EXPECT_THAT(Refusal("explode"), HasSubstr("scene DIR, camera FAULT [N]"));
  EXPECT_THAT(Refusal("unplug now"), HasSubstr("'unplug' with 1 words after it"));
  EXPECT_THAT(Refusal("brown-out soon"), HasSubstr("the time in ms is 'soon'"));
  EXPECT_THAT(Refusal("nudge 1"), HasSubstr("need nudge DX DY"));
  EXPECT_THAT(Refusal("nudge 1 x"), HasSubstr("DY is 'x'; need a number"));
  EXPECT_THAT(Refusal("camera explode"), HasSubstr("'explode' is no fault of the camera"));
  EXPECT_THAT(Refusal("camera busy 0"), HasSubstr("need a whole number from 1"));
  EXPECT_THAT(Refusal("camera busy 1.5"), HasSubstr("need a whole number from 1"));
  EXPECT_THAT(Refusal("ambient -1"), HasSubstr("need a number from 0"));
  EXPECT_THAT(Refusal("swap led-1"), HasSubstr("need swap A B"));
  EXPECT_THAT(Refusal("swap led-1 led-1"), HasSubstr("need two lights"));
  EXPECT_THAT(Refusal("double 1 13"),
              HasSubstr("'13' is no light of the scene; need one of led-0"));
  EXPECT_THAT(Refusal("light x 0.5"), HasSubstr("'x' is no light"));
  EXPECT_THAT(Refusal("light 1 80%"), HasSubstr("'80%'; need a number"));
  EXPECT_THAT(Refusal("shade 1 2 3"), HasSubstr("need shade X Y RADIUS FACTOR [N]"));
  EXPECT_THAT(Refusal("shade 1 2 3 1.5"), HasSubstr("FACTOR is '1.5'"));
  EXPECT_THAT(Refusal("scene"), HasSubstr("need scene DIR"));
}

TEST_F(RigCommandsTest, WiringLevelsAndAmbientLight) {
  HasCamera();
  EXPECT_NEAR(Red(), RedOf(3), kOneReading);
  Do("swap led-3 5");
  EXPECT_NEAR(Red(), RedOf(5), kOneReading);
  Do("swap led-3 led-5");
  Do("double 3 led-6");
  EXPECT_NEAR(Red(), RedOf(3) + RedOf(6, 0.0), kOneReading);
  Do("light 6 0");
  Do("light led-3 0.8");
  EXPECT_NEAR(Red(), 0.8 * RedOf(3, 0.0) + kSmallAmbient, kOneReading);
  Do("ambient 4");
  EXPECT_NEAR(Red(), 0.8 * RedOf(3, 0.0) + 4 * kSmallAmbient, kOneReading);
}

TEST_F(RigCommandsTest, NudgesAndShades) {
  HasCamera();
  Do("nudge 4 -2.0");
  EXPECT_NEAR(Red(), SmallRadiance(3, 0, 6, 12) + kSmallAmbient, kOneReading);
  Do("nudge -4 2");
  Do("shade 10 10 4 0.5");
  EXPECT_NEAR(Red(), 0.5 * RedOf(3), kOneReading);
  Do("shade 10 10 4 0.25 2");
  EXPECT_NEAR(Red(), 0.25 * RedOf(3), kOneReading);
  EXPECT_NEAR(Red(), 0.25 * RedOf(3), kOneReading);
  EXPECT_NEAR(Red(), RedOf(3), kOneReading);
}

TEST_F(RigCommandsTest, AnotherSceneIsReadAndSaidToBe) {
  HasCamera();
  const std::filesystem::path dir = folder_.Path() / "another scene";
  WriteSmallScene(dir, /*ambient=*/0.1);
  Do("scene " + dir.string());
  EXPECT_NEAR(Red(), RedOf(3, 0.0) + 0.1, kOneReading);
  while (EventsSoFar().empty()) {
    commands_->Step();
  }
  EXPECT_EQ(EventsSoFar()[0]["event"], "scene");
  EXPECT_EQ(EventsSoFar()[0]["folder"], dir.string());
  EXPECT_EQ(EventsSoFar()[0]["read"], true);
  EXPECT_FALSE(commands_->Do("scene /nowhere"));
  EXPECT_THAT(failures_, IsEmpty());
}

TEST_F(RigCommandsTest, EveryFaultOfTheCameraAndItsEnd) {
  HasCamera();
  for (const char* fault :
       {"busy", "no-event", "late-event", "gone", "dropped-mid-file", "short-transfer",
        "truncated-file", "card-full", "asleep", "wrong-exposure", "two-files", "none"}) {
    EXPECT_TRUE(commands_->Parse(std::string("camera ") + fault)) << fault;
  }
  Do("camera busy 2");
  EXPECT_EQ(AskForCapture(), ptp::kDeviceBusy);
  EXPECT_EQ(AskForCapture(), ptp::kDeviceBusy);
  Do("camera asleep");
  AskForCapture();
  EXPECT_TRUE(camera_->Asleep());
  Do("camera wake");
  EXPECT_FALSE(camera_->Asleep());
}

TEST_F(RigCommandsTest, CommandsComeWithTheirCapture) {
  HasCamera();
  ASSERT_TRUE(commands_->Schedule("2:camera card-full"));
  ASSERT_TRUE(commands_->Schedule("2:light led-3 0.5"));
  ASSERT_TRUE(commands_->Schedule("2:unplug"));
  ASSERT_TRUE(commands_->Schedule("3+0.001ms:plug"));
  commands_->CaptureAsked(1);
  EXPECT_NEAR(Red(), RedOf(3), kOneReading);
  EXPECT_EQ(AskForCapture(), ptp::kOk);  // the first one

  commands_->CaptureAsked(2);
  EXPECT_EQ(camera_->Report().captures, 1);
  EXPECT_NEAR(Red(), 0.5 * RedOf(3, 0.0) + kSmallAmbient, kOneReading);
  EXPECT_TRUE(board_->Plugged());  // the board's own thread does it
  commands_->Step();
  EXPECT_FALSE(board_->Plugged());
  commands_->CaptureAsked(3);
  while (!board_->Plugged()) {
    commands_->Step();
  }
  EXPECT_THAT(failures_, IsEmpty());
}

TEST_F(RigCommandsTest, TheCameraItselfTellsWhichCaptureIsAskedFor) {
  HasCamera();
  ASSERT_TRUE(commands_->Schedule("1:camera card-full"));
  EXPECT_EQ(AskForCapture(), ptp::kStoreFull);  // its own, and it is the first one still
  EXPECT_EQ(AskForCapture(), ptp::kOk);
}

TEST_F(RigCommandsTest, WhatIsNoTimeOrNoCommandIsRefusedBeforeItsCapture) {
  HasCamera();
  EXPECT_THAT(ScheduleRefusal("unplug"), HasSubstr("need N:COMMAND or N+TIME:COMMAND"));
  EXPECT_THAT(ScheduleRefusal("0:unplug"), HasSubstr("the capture is '0'"));
  EXPECT_THAT(ScheduleRefusal("x:unplug"), HasSubstr("the capture is 'x'"));
  EXPECT_THAT(ScheduleRefusal("1+5:unplug"), HasSubstr("need one such as 12ms"));
  EXPECT_THAT(ScheduleRefusal("1+ms:unplug"), HasSubstr("the time is ''"));
  EXPECT_THAT(ScheduleRefusal("1:explode"), HasSubstr("'explode' is no command"));
}

TEST_F(RigCommandsTest, WhatFailsWhenItsTimeHasComeIsSaid) {
  HasCamera();
  ASSERT_TRUE(commands_->Schedule("1:scene /nowhere"));
  commands_->CaptureAsked(1);
  EXPECT_THAT(failures_, ElementsAre(HasSubstr("/nowhere")));
}

}  // namespace
}  // namespace sateen::testing::rig_commands_test
