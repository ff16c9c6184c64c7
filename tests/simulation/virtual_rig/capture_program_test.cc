#include <gmock/gmock.h>

#include <cstdlib>
#include <string>

#include "tests/simulation/virtual_rig/running_rig.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

// Whole captures by the programs as people type them, on the virtual rig: real firmware,
// libserialport, libgphoto2 and LibRaw. `capture_bench` does the same for every fault in every
// phase.
namespace sateen::testing::capture_program_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class CaptureProgram : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = new TempFolder();
    // The sample on a small sensor, so that the sanitizers get through in time.
    json rig = json::parse(std::ifstream(testing::SourceDir() + "/samples/rigs/ring10.json"));
    rig["camera"]["size_px"] = {160, 120};
    rig["camera"]["k"] = {488.0, 488.0, 79.5, 59.5};
    rig["calibration"]["lights"] = json::object();
    WriteText(scene_->Path() / "rig.json", rig.dump());
    json scene =
        json::parse(std::ifstream(testing::SourceDir() + "/samples/scenes/twill-table.json"));
    scene["rig"] = "rig.json";
    WriteText(scene_->Path() / "scene.json", scene.dump());
    const ShellResult rendered =
        Shell(kSateen + " simulate " + (scene_->Path() / "scene.json").string() + " --linear -o " +
              (scene_->Path() / "table").string());
    ASSERT_EQ(rendered.exit_status, 0) << rendered.out;
  }
  static void TearDownTestSuite() {
    delete scene_;
    scene_ = nullptr;
  }

  CaptureProgram() { setenv("HOME", folder_.Path().c_str(), 1); }

  // `command` of sateen under the rig.
  ShellResult OnRig(const std::string& rig_options, const std::string& command) {
    return Shell(kRig + " run --scene " + (scene_->Path() / "table").string() + " --events " +
                 events_.string() + " " + rig_options + " -- " + command);
  }
  [[nodiscard]] std::string Capture(const std::string& options) const {
    return kSateen + " capture --rig " + (scene_->Path() / "rig.json").string() + " -o " +
           session_.string() + " --margin 9s " + options;
  }
  [[nodiscard]] std::string Resume() const {
    return kSateen + " capture --resume " + session_.string() + " --margin 9s";
  }
  void ExpectWhole() {
    const ShellResult verified = Shell(kSateen + " session verify " + session_.string());
    EXPECT_EQ(verified.exit_status, 0) << verified.out;
  }
  // By the pins, when the rig ended.
  void ExpectAllLightsOff() {
    std::map<int, double> level;
    for (const json& event : Events(events_)) {
      if (event["event"] == "light") {
        level[event["channel"]] = event["level"];
      }
    }
    for (const auto& [channel, last] : level) {
      EXPECT_EQ(last, 0.0) << channel;
    }
  }

  // Returns the median error of the normals of plain least squares. [deg]
  double MedianErrorOf(const fs::path& session) {
    const ShellResult solved =
        Shell(kSateen + " solve " + session.string() + " --robust none --json --truth " +
              (scene_->Path() / "table").string() + " -o " + (folder_.Path() / "maps").string() +
              " 2>/dev/null");
    EXPECT_EQ(solved.exit_status, 0) << solved.out;
    return json::parse(solved.out)["angular_error_deg"]["median"];
  }

  static inline TempFolder* scene_ = nullptr;
  const TempFolder folder_;
  const fs::path session_ = folder_.Path() / "twill";
  const fs::path events_ = folder_.Path() / "events.jsonl";
};

TEST_F(CaptureProgram, FindsTheExposureAndTakesEveryFrame) {
  const ShellResult captured = OnRig("", Capture("--json 2>/dev/null"));
  ASSERT_EQ(captured.exit_status, 0) << captured.out;
  const json report = json::parse(captured.out);
  EXPECT_EQ(report["taken"], 13);
  EXPECT_EQ(report["rejected"], 0);
  ExpectAllLightsOff();
  ExpectWhole();
  // Against the same as the simulator makes a RAW session of it. What is left in the median is
  // noise, of which the exposure that was found may have a little less.
  const ShellResult simulated =
      Shell(kSateen + " simulate " + (scene_->Path() / "scene.json").string() + " -o " +
            (folder_.Path() / "raw").string());
  ASSERT_EQ(simulated.exit_status, 0) << simulated.out;
  const double captured_deg = MedianErrorOf(session_);
  const double simulated_deg = MedianErrorOf(folder_.Path() / "raw");
  EXPECT_LT(captured_deg, 1.1 * simulated_deg);
  EXPECT_GT(captured_deg, 0.75 * simulated_deg);
}

TEST_F(CaptureProgram, GoesOnAfterItWasKilled) {
  // With the first event of the third frame's light the program is killed, which says nothing more.
  const ShellResult killed = OnRig("", "sh -c 'exec 3>&1; " + Capture("--exposure 1/50") +
                                           " & while ! grep -q \"led-1\" " + events_.string() +
                                           "; do sleep 0.01; done; kill -9 $!; sleep 2.5'");
  EXPECT_EQ(killed.exit_status, 0) << killed.out;
  ExpectAllLightsOff();  // by the board itself
  EXPECT_FALSE(fs::exists(session_ / "session.json"));
  const ShellResult resumed = OnRig("", Resume());
  ASSERT_EQ(resumed.exit_status, 0) << resumed.out;
  EXPECT_THAT(resumed.out, HasSubstr("kept from before"));
  ExpectWhole();
}

TEST_F(CaptureProgram, APulledCableCostsAFrameAtMost) {
  const ShellResult captured = OnRig("--at 5:unplug --at 5+300ms:plug", Capture("--exposure 1/50"));
  ASSERT_EQ(captured.exit_status, 0) << captured.out;
  EXPECT_THAT(captured.out, HasSubstr("rejected and taken again"));
  ExpectAllLightsOff();
  ExpectWhole();
}

TEST_F(CaptureProgram, AFaultOfTheCameraCostsAFrameAtMost) {
  const ShellResult captured =
      OnRig("--at '4:camera dropped-mid-file' --at '9:camera truncated-file'",
            Capture("--exposure 1/50"));
  ASSERT_EQ(captured.exit_status, 0) << captured.out;
  ExpectAllLightsOff();
  ExpectWhole();
}

// Ctrl-C, once, in the middle of an exposure that a daemon takes; then a dry run beside the daemon,
// which is idle.
TEST_F(CaptureProgram, PreviewByADaemonHearsCtrlC) {
  const std::string look = (folder_.Path() / "look.jpg").string();
  WriteText(folder_.Path() / "daemon.sh",
            "export SATEEN_SOCKET=" + (folder_.Path() / "s.sock").string() + "\n" +  //
                kSateen + " serve & daemon=$!\n" + "unset SATEEN_CAMERA SATEEN_PORT\n" +
                "while ! [ -S $SATEEN_SOCKET ]; do sleep 0.05; done\n" +
                "timeout --foreground --preserve-status -s INT 2 " + kSateen + " preview -o " +
                look + " --light 3 --exposure 4s\n" + "echo preview ended with $?\n" +
                Capture("--exposure 1/50 --dry-run") + "\n" + "kill $daemon; wait $daemon\n");
  const ShellResult ended = OnRig("", "sh " + (folder_.Path() / "daemon.sh").string());
  EXPECT_THAT(ended.out, HasSubstr("preview ended with 6"));
  EXPECT_THAT(ended.out, HasSubstr("ready to capture 13 frames"));
  EXPECT_FALSE(fs::exists(look));
  ExpectAllLightsOff();
}

TEST_F(CaptureProgram, NamesTheLightsThatWereSwapped) {
  const ShellResult captured = OnRig("--fault 'swap led-2 led-7'", Capture("--exposure 1/50"));
  EXPECT_EQ(captured.exit_status, 3) << captured.out;
  EXPECT_THAT(captured.out, HasSubstr("'led-2'"));
  EXPECT_THAT(captured.out, HasSubstr("'led-7'"));
  ExpectAllLightsOff();
  const ShellResult mended = OnRig("", Resume());
  EXPECT_EQ(mended.exit_status, 0) << mended.out;
  ExpectWhole();
}

}  // namespace
}  // namespace sateen::testing::capture_program_test
