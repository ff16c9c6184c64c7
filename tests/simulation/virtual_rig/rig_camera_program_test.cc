#include <gmock/gmock.h>

#include <cstdlib>
#include <string>

#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/devices/ptp_camera.h"
#include "tests/simulation/virtual_rig/running_rig.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

// The virtual rig's camera as programs find it: sateen and PtpCamera with libgphoto2 as it is,
// frames lit by what the firmware's pins do.
namespace sateen::testing::rig_camera_program_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const std::string kScene = testing::SourceDir() + "/samples/scenes/room-light.json";
constexpr std::chrono::seconds kLong(60);
constexpr double kWhite = 15892.0;  // white of the D5100
constexpr float kFullScale = 1.5F;  // the program's

class RigCameraProgram : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = new TempFolder();
    const ShellResult rendered =
        Shell(kSateen + " simulate " + Small(kScene).string() + " --linear -o " + Scene());
    ASSERT_EQ(rendered.exit_status, 0) << rendered.out;
  }
  static void TearDownTestSuite() {
    delete scene_;
    scene_ = nullptr;
  }
  // The sample with the small rig.
  static fs::path Small(const fs::path& sample) {
    json scene = json::parse(std::ifstream(sample));
    scene["rig"] = testing::SourceDir() + "/samples/rigs/ring10-small.json";
    WriteText(scene_->Path() / sample.filename(), scene.dump());
    return scene_->Path() / sample.filename();
  }
  static std::string Scene() { return (scene_->Path() / "linear").string(); }

  RigCameraProgram() {
    setenv("HOME", folder_.Path().c_str(), 1);  // libgphoto2 keeps settings there
    fs::create_directory(frames_);
  }

  std::unique_ptr<PtpCamera> Opened(const RunningRig& rig) {
    auto camera = std::make_unique<PtpCamera>(
        PtpCameraOptions{.port = rig.Variable("SATEEN_CAMERA"), .answer_timeout = kLong});
    const auto opened = camera->Open();
    EXPECT_TRUE(opened) << opened.error().message;
    const auto set = camera->Configure({.exposure_s = 0.02, .f_number = 8, .iso = 100});
    EXPECT_TRUE(set) << set.error().message;
    return camera;
  }
  RawMosaic Frame(PtpCamera& camera) {
    const auto file = camera.Capture(frames_, kLong);
    EXPECT_TRUE(file) << file.error().message;
    const auto mosaic = file ? ReadRawMosaic(file->path) : tl::unexpected(file.error());
    EXPECT_TRUE(mosaic) << mosaic.error().message;
    return mosaic.value_or(RawMosaic{.samples = Image<float>(160, 120)});
  }
  // The mean difference of a frame's red and the scene's frame of this name, in parts of white.
  static double RedAgainst(const RawMosaic& frame, const std::string& name) {
    const auto truth = ReadPhoto(Scene() + "/frames/" + name + ".exr");
    EXPECT_TRUE(truth) << truth.error().message;
    double sum = 0.0;
    for (int y = 0; y < 120; y += 2) {
      for (int x = 0; x < 160; x += 2) {
        sum += static_cast<double>(
            std::abs(frame.samples.At(x, y) - truth->rgb[0].At(x, y) / kFullScale));
      }
    }
    return sum / (60 * 80);
  }

  static inline TempFolder* scene_ = nullptr;
  const TempFolder folder_;
  const fs::path frames_ = folder_.Path() / "frames";
};

// Mean of |noise| at half of white: 0.8 sqrt(0.5 / 47000); with what 14 bits round away.
constexpr double kNoise = 0.003;

TEST_F(RigCameraProgram, SateenFindsBoardAndCamera) {
  const ShellResult result =
      Shell(kRig + " run --scene " + Scene() + " -- " + kSateen + " devices");
  EXPECT_EQ(result.exit_status, 0) << result.out;
  EXPECT_THAT(result.out, HasSubstr("/dev/ttyACM0"));
  EXPECT_THAT(result.out, HasSubstr("D5100"));
  const ShellResult generic =
      Shell(kRig + " run --camera generic --scene " + Scene() + " -- " + kSateen + " devices");
  EXPECT_THAT(generic.out, HasSubstr("Virtual Camera"));
}

TEST_F(RigCameraProgram, AFrameShowsTheLightThatTheFirmwareHasOn) {
  RunningRig rig(folder_.Path(), "--scene '" + Scene() + "'");
  const auto camera = Opened(rig);
  const RawMosaic dark = Frame(*camera);
  EXPECT_EQ(dark.white, kWhite);
  EXPECT_LT(RedAgainst(dark, "dark"), kNoise);
  EXPECT_GT(RedAgainst(dark, "led-3"), 10 * kNoise);

  const fs::path enough = folder_.Path() / "enough";
  std::FILE* light =
      StartShell("export " + rig.Environment() + "; " + kSateen + " light led-3 --rig " + Scene() +
                 "/rig.json --level 100% & " + "while [ ! -e " + enough.string() +
                 " ]; do sleep 0.05; done; " + "kill $!; wait");
  EXPECT_EQ(rig.WaitFor("light")["name"], "led-3");
  // It is as bright as it will be some 20 ms later: not in this frame, perhaps.
  RawMosaic lit = Frame(*camera);
  lit = Frame(*camera);
  const json event = rig.WaitFor("exposure", 3);
  EXPECT_LT(RedAgainst(lit, "led-3"), kNoise) << event.dump();
  EXPECT_GT(RedAgainst(lit, "led-4"), 3 * kNoise);
  EXPECT_EQ(event["number"], 3);
  EXPECT_EQ(event["exposure_s"], 0.02);
  EXPECT_EQ(event["lit"].size(), 1U);
  EXPECT_EQ(event["lit"]["led-3"], 1.0) << "exactly";
  EXPECT_GT(event["bytes"].get<int>(), 160 * 120 * 2);
  WriteText(enough, "");
  EndShell(light);
}

TEST_F(RigCameraProgram, CommandsReachCameraAndScene) {
  RunningRig rig(folder_.Path(),
                 "--scene '" + Scene() + "' --fault 'ambient 0' --at '2:ambient 1'");
  const auto camera = Opened(rig);
  const RawMosaic none = Frame(*camera);
  EXPECT_GT(RedAgainst(none, "dark"), kNoise);
  EXPECT_LT(RedAgainst(Frame(*camera), "dark"), kNoise);

  rig.Tell("light led-3");
  rig.WaitForError("need light K FACTOR");
  rig.Tell("scene " + folder_.Path().string());
  rig.WaitForError("session.json");
  fs::copy(Scene(), folder_.Path() / "same", fs::copy_options::recursive);
  rig.Tell("scene " + (folder_.Path() / "same").string());
  EXPECT_EQ(rig.WaitFor("scene")["read"], true);
  rig.Tell("camera truncated-file");
  rig.Tell("explode");
  rig.WaitForError("'explode' is no command");  // so the line before it is done
  const auto cut = camera->Capture(frames_, kLong);
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().message, HasSubstr("does not decode"));
}

TEST_F(RigCameraProgram, SaysWhatIsWrongBeforeItStarts) {
  const auto refusal = [](const std::string& options, int status) {
    const ShellResult result = Shell(kRig + " run " + options + " -- true");
    EXPECT_EQ(result.exit_status, status) << options << '\n' << result.out;
    return result.out;
  };
  EXPECT_THAT(refusal("--camera nikon", 2), HasSubstr("there is no camera without a scene"));
  EXPECT_THAT(refusal("--at 1:unplug", 2), HasSubstr("there is no camera without a scene"));
  EXPECT_THAT(refusal("--fault explode", 2), HasSubstr("'explode' is no command"));
  const std::string scene = "--scene " + Scene() + " ";
  EXPECT_THAT(refusal(scene + "--at 1:explode", 2), HasSubstr("'explode' is no command"));
  EXPECT_THAT(refusal(scene + "--camera canon", 2), HasSubstr("canon"));
  EXPECT_THAT(refusal(scene + "--sensor x", 2), HasSubstr("'x' is no sensor"));
  EXPECT_THAT(refusal(scene + "--ambient=-1", 2), HasSubstr("--ambient"));
  EXPECT_THAT(refusal(scene + "--rig " + kRing, 3), HasSubstr("need a scene of the same rig"));
  EXPECT_THAT(refusal("--scene /nowhere", 4), HasSubstr("/nowhere"));
}

}  // namespace
}  // namespace sateen::testing::rig_camera_program_test
