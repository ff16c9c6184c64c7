#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "cli/capture.h"
#include "cli/preview.h"
#include "core/files/file_io.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"

// `sateen capture` and `sateen preview` on the real firmware in simulated time.
namespace sateen::cli::capture_command_test {
namespace {

namespace fs = std::filesystem;
using sateen::testing::CaptureRig;
using sateen::testing::LightImages;
using sateen::testing::LitCamera;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class CaptureCommand : public sateen::testing::BoardTest {
 protected:
  CaptureCommand() : rig_(CaptureRig()) {
    sateen::testing::WriteText(rig_file_, RigToJson(rig_));
    args_.request.rig = rig_file_;
    args_.request.output = dir_;
    args_.request.options.keep_alive = std::chrono::milliseconds(0);
    args_.settle = "5ms";
    args_.exposure = "20ms";
    NewDevices();
  }

  // As a new run of the program has them.
  void NewDevices() {
    auto camera = std::make_unique<LitCamera>(*board_, LightImages(rig_));
    camera_ = camera.get();
    camera_->exposure_counts = true;
    for (double time_s = 0.0005; time_s < 2.0; time_s *= 2.0) {
      camera_->times_s.push_back(time_s);
    }
    devices_.emplace(std::make_unique<SimulatedPort>(*board_), std::move(camera));
  }

  int Run() {
    out_.str("");
    log_.str("");
    const int status = RunCaptureWith(args_, *devices_, {.threads = 1}, out_, log_);
    EXPECT_THAT(board_->Lit(), IsEmpty());
    return status;
  }

  sateen::testing::TempFolder temp_;
  fs::path dir_ = temp_.Path() / "twill";
  fs::path rig_file_ = temp_.Path() / "rig.json";
  Rig rig_;
  LitCamera* camera_ = nullptr;
  std::optional<RigDevices> devices_;
  CaptureArgs args_;
  std::ostringstream out_;
  std::ostringstream log_;
};

TEST_F(CaptureCommand, SaysWhatItCaptured) {
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("13 frames, 13 taken in"));
  EXPECT_THAT(out_.str(), HasSubstr("exposure 1/50 s, f/8, ISO 100"));
  EXPECT_THAT(out_.str(), HasSubstr("led-9 100."));
  EXPECT_THAT(out_.str(), Not(HasSubstr("rejected")));
}

TEST_F(CaptureCommand, SaysItAsJson) {
  args_.json = true;
  args_.sheet = true;
  args_.level = "50%";
  ASSERT_EQ(Run(), 0) << log_.str();
  const nlohmann::json report = nlohmann::json::parse(out_.str());
  EXPECT_EQ(report["schema"], "sateen.capture/1");
  EXPECT_EQ(report["kind"], "sheet");
  EXPECT_EQ(report["frames"], 13);
  EXPECT_EQ(report["exposures_s"], nlohmann::json({0.02}));
  EXPECT_EQ(report["lights"].size(), 10U);
  EXPECT_NEAR(report["lights"][4]["level"].get<double>(), 1.0, 0.02);
}

// Ctrl-C, then --resume; then again, when there is nothing left to do and no device either.
TEST_F(CaptureCommand, GoesOnWhereItWasStopped) {
  std::atomic<bool> cancel = false;
  camera_->on_exposed = [&](int capture) { cancel = capture == 4; };
  EXPECT_EQ(RunCaptureWith(args_, *devices_, {.threads = 1, .cancel = &cancel}, out_, log_), 6);
  EXPECT_THAT(log_.str(), HasSubstr("--resume " + dir_.string()));
  NewDevices();
  EXPECT_EQ(Run(), 2);
  EXPECT_THAT(log_.str(), HasSubstr("continue it: sateen capture --resume " + dir_.string()));
  args_.resume = dir_;
  args_.exposure = "";
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("13 frames, 9 taken"));
  EXPECT_THAT(out_.str(), HasSubstr("4 kept from before"));
  devices_.emplace(RigDeviceNames{.port = "/dev/none", .camera = "folder:/none"});
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("0 taken"));
}

TEST_F(CaptureCommand, AnExposureThatClipsIsNoDeadEnd) {
  args_.exposure = "1s";
  EXPECT_EQ(Run(), 3);
  EXPECT_THAT(log_.str(),
              HasSubstr("sateen capture --resume " + dir_.string() + " --exposure auto"));
  args_.resume = dir_;
  args_.exposure = "";
  EXPECT_EQ(Run(), 3);  // as before
  args_.exposure = "auto";
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("13 frames, 13 taken"));
  EXPECT_EQ(Run(), 2);
  EXPECT_THAT(log_.str(), HasSubstr("is a complete session"));
}

TEST_F(CaptureCommand, ADryRunTakesAndWritesNothing) {
  args_.dry_run = true;
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("ready to capture 13 frames"));
  EXPECT_THAT(out_.str(), HasSubstr("exposure 1/50 s"));
  args_.json = true;
  args_.exposure = "auto";
  ASSERT_EQ(Run(), 0) << log_.str();
  const nlohmann::json report = nlohmann::json::parse(out_.str());
  EXPECT_EQ(report["schema"], "sateen.capture.forecast/1");
  EXPECT_FALSE(report.contains("exposure_s"));
  EXPECT_EQ(report["frames"].size(), 13U);
  EXPECT_EQ(camera_->captures, 0);
  EXPECT_FALSE(fs::exists(dir_));
}

TEST_F(CaptureCommand, ARigThatTheBoardCannotSwitchIsRefusedBeforeAnythingIsWritten) {
  rig_.lights[3].channel = 14;
  sateen::testing::WriteText(rig_file_, RigToJson(rig_));
  EXPECT_EQ(Run(), 3);
  EXPECT_THAT(log_.str(), HasSubstr("light 'led-3' of the rig is on channel 14"));
  EXPECT_FALSE(fs::exists(dir_));
}

// The rig that `calibrate lens` leaves behind has no lights.
TEST_F(CaptureCommand, ARigWithoutLightsIsRefused) {
  rig_.lights.clear();
  sateen::testing::WriteText(rig_file_, RigToJson(rig_));
  EXPECT_EQ(Run(), 3);
  EXPECT_THAT(log_.str(), HasSubstr("has no lights"));
  args_.dry_run = true;
  EXPECT_EQ(Run(), 3);
}

TEST_F(CaptureCommand, AnExposureThatNoLightMayLastIsRefusedBeforeAnyFrame) {
  args_.exposure = "15s";
  EXPECT_EQ(Run(), 2);
  EXPECT_THAT(log_.str(), HasSubstr("sateen light limits"));
  EXPECT_EQ(camera_->captures, 0);
  EXPECT_FALSE(fs::exists(dir_));
}

TEST_F(CaptureCommand, ADryRunSeesASessionThatIsThere) {
  ASSERT_EQ(Run(), 0) << log_.str();
  args_.dry_run = true;
  EXPECT_EQ(Run(), 2);
  EXPECT_THAT(log_.str(), HasSubstr("holds a session already"));
}

TEST_F(CaptureCommand, AFolderOfSomebodyElseIsLeftAlone) {
  fs::create_directories(dir_ / "incoming");
  sateen::testing::WriteText(dir_ / "incoming" / "notes.txt", "mine");
  ASSERT_EQ(Run(), 0) << log_.str();
  EXPECT_TRUE(fs::exists(dir_ / "incoming" / "notes.txt"));
}

TEST_F(CaptureCommand, DevicesThatAreNotThereLeaveNoFolder) {
  devices_.emplace(RigDeviceNames{.port = "/dev/none"});
  EXPECT_EQ(Run(), 5);
  EXPECT_THAT(log_.str(), HasSubstr("/dev/none"));
  EXPECT_FALSE(fs::exists(dir_));
}

TEST_F(CaptureCommand, PreviewShowsOneLight) {
  PreviewArgs args{.output = temp_.Path() / "look.jpg", .light = "led-3"};
  args.request.rig = rig_file_;
  ASSERT_EQ(RunPreviewWith(args, *devices_, {}, out_, log_), 0) << log_.str();
  EXPECT_THAT(out_.str(), HasSubstr("48x32 px"));
  EXPECT_EQ(board_->Records()[3].times_on, camera_->captures);
  const Result<Photo> photo = ReadPhoto(args.output);
  ASSERT_TRUE(photo) << photo.error().message;
  EXPECT_EQ(photo->rgb.Size(), (ImageSize{48, 32}));
  EXPECT_THAT(board_->Lit(), IsEmpty());
  args.light = "led-77";
  EXPECT_EQ(RunPreviewWith(args, *devices_, {}, out_, log_), 3);
  EXPECT_THAT(log_.str(), HasSubstr("no light of that name"));
}

TEST_F(CaptureCommand, PreviewWritesNothingButJpegs) {
  PreviewArgs args{.output = temp_.Path() / "look.png", .light = "0"};
  EXPECT_EQ(RunPreviewWith(args, *devices_, {}, out_, log_), 2);
  EXPECT_THAT(log_.str(), HasSubstr("look.png: a preview is a JPEG"));
  EXPECT_FALSE(fs::exists(args.output));
  args.output = temp_.Path() / "look.JPEG";
  EXPECT_EQ(RunPreviewWith(args, *devices_, {}, out_, log_), 0) << log_.str();
}

// Saturated pixels are magenta.
TEST_F(CaptureCommand, PreviewMarksWhatSaturates) {
  PreviewArgs args{.output = temp_.Path() / "look.jpg", .light = "0", .exposure = "1s"};
  ASSERT_EQ(RunPreviewWith(args, *devices_, {}, out_, log_), 0) << log_.str();
  const Result<Photo> photo = ReadPhoto(args.output);
  ASSERT_TRUE(photo) << photo.error().message;
  EXPECT_GT(photo->rgb[0].At(24, 16), 0.9F);
  EXPECT_LT(photo->rgb[1].At(24, 16), 0.05F);
  EXPECT_GT(photo->rgb[2].At(24, 16), 0.9F);
}

}  // namespace
}  // namespace sateen::cli::capture_command_test
