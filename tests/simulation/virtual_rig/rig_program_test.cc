#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "tests/simulation/virtual_rig/running_rig.h"
#include "tests/testing/files.h"

// The programs as people start them: sateen-virtual-rig with the firmware, and under it sateen with
// libserialport. These run in real time; nothing here depends on how fast the machine is.
namespace sateen::testing::rig_program_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// The changes of the lights, as "led-3 0.5".
std::vector<std::string> LightEvents(const std::filesystem::path& path) {
  std::vector<std::string> lights;
  for (const json& event : Events(path)) {
    if (event["event"] == "light") {
      lights.push_back(event["name"].get<std::string>() + " " + event["level"].dump());
    }
  }
  return lights;
}

TEST(RigProgram, SateenFindsTheVirtualBoardByItsUsbId) {
  const ShellResult result = Shell(kRig + " run -- " + kSateen + " devices --json");

  ASSERT_EQ(result.exit_status, 0) << result.out;
  const json devices = json::parse(result.out);
  const json& ports = devices.contains("devices") ? devices["devices"] : devices["ports"];
  ASSERT_EQ(ports.size(), 1U) << result.out;
  EXPECT_EQ(ports[0]["port"], "/dev/ttyACM0");
  EXPECT_EQ(ports[0]["usb"], "2341:0043");
  EXPECT_EQ(ports[0]["kind"], "led-board");
  EXPECT_EQ(ports[0]["lights"], 14);
}

TEST(RigProgram, ALightShinesAtTheLevelAndGoesOff) {
  const TempFolder folder;
  const std::filesystem::path events = folder.Path() / "events.jsonl";

  const ShellResult result = Shell(kRig + " run --rig " + kRing + " --events " + events.string() +
                                   " -- " + kSateen + " light 3 --level 50% --for 300ms");

  EXPECT_EQ(result.exit_status, 0) << result.out;
  EXPECT_THAT(LightEvents(events), ::testing::ElementsAre("led-3 0.5", "led-3 0"));
  EXPECT_EQ(Events(events).front()["event"], "start");
  EXPECT_EQ(Events(events).back()["event"], "end");
}

TEST(RigProgram, StatusAndOffWork) {
  const ShellResult result =
      Shell(kRig + " run -- sh -c '" + kSateen + " light off && " + kSateen + " light status'");
  EXPECT_EQ(result.exit_status, 0) << result.out;
  EXPECT_THAT(result.out, HasSubstr("all lights off"));
  EXPECT_THAT(result.out, HasSubstr("/dev/ttyACM0"));
}

TEST(RigProgram, AnUnoThatResetsWhenItIsOpenedWorksToo) {
  const ShellResult result =
      Shell(kRig + " run --opening-resets -- " + kSateen + " light 0 --for 50ms");
  EXPECT_EQ(result.exit_status, 0) << result.out;
}

TEST(RigProgram, RunEndsWithTheStatusOfItsCommand) {
  EXPECT_EQ(Shell(kRig + " run -- sh -c 'exit 37'").exit_status, 37);
  EXPECT_EQ(Shell(kRig + " run -- sh -c 'kill -9 $$'").exit_status, 128 + 9);
  const ShellResult missing = Shell(kRig + " run -- /nowhere/at-all");
  EXPECT_EQ(missing.exit_status, 2);
  EXPECT_THAT(missing.out, HasSubstr("'/nowhere/at-all' cannot be started"));
}

TEST(RigProgram, SaysWhatIsWrongWithItsInputs) {
  const TempFolder folder;
  const ShellResult no_firmware = Shell(kRig + " run --firmware /nowhere.hex -- true");
  EXPECT_EQ(no_firmware.exit_status, 4);
  EXPECT_THAT(no_firmware.out, HasSubstr("/nowhere.hex"));

  WriteText(folder.Path() / "no.hex", "hello\n");
  const ShellResult bad =
      Shell(kRig + " run --firmware " + (folder.Path() / "no.hex").string() + " -- true");
  EXPECT_EQ(bad.exit_status, 3);
  EXPECT_THAT(bad.out, HasSubstr("line 1 is no Intel HEX record"));

  json ring = json::parse(std::ifstream(kRing));
  ring["lights"][9]["channel"] = 14;
  WriteText(folder.Path() / "rig.json", ring.dump());
  const ShellResult rig =
      Shell(kRig + " run --rig " + (folder.Path() / "rig.json").string() + " -- true");
  EXPECT_EQ(rig.exit_status, 3);
  EXPECT_THAT(rig.out, HasSubstr("'led-9' is on channel 14; the board has channels 0 to 13"));

  EXPECT_EQ(Shell(kRig + " --no-such-option").exit_status, 2);
}

TEST(RigProgram, UnpluggingEndsALightAndTheBoardIsFoundAgain) {
  const TempFolder folder;
  RunningRig rig(folder.Path());
  EXPECT_TRUE(std::filesystem::is_symlink(folder.Path() / "port"));
  std::FILE* light = StartShell(rig.Environment() + kSateen + " light 5");
  EXPECT_EQ(rig.WaitFor("light")["name"], "led-5");

  rig.Tell("unplug");
  rig.WaitFor("unplug");
  EXPECT_EQ(rig.WaitFor("light", 2)["level"], 0.0);
  EXPECT_FALSE(std::filesystem::is_symlink(folder.Path() / "port"));
  const ShellResult lost = EndShell(light);
  EXPECT_EQ(lost.exit_status, 5) << lost.out;
  const ShellResult gone = Shell(rig.Environment() + kSateen + " light status");
  EXPECT_EQ(gone.exit_status, 5) << gone.out;

  rig.Tell("plug");
  rig.WaitFor("plug");
  const ShellResult back = Shell(rig.Environment() + kSateen + " light status");
  EXPECT_EQ(back.exit_status, 0) << back.out;
}

TEST(RigProgram, AKilledHostLeavesNoLightOn) {
  const TempFolder folder;
  RunningRig rig(folder.Path());
  const ShellResult killed =
      Shell(rig.Environment() + "sh -c '" + kSateen + " light 5 & while ! grep -q \"level.:0.5\" " +
            (folder.Path() / "events.jsonl").string() + "; do sleep 0.05; done; kill -9 $!'");
  EXPECT_EQ(killed.exit_status, 0) << killed.out;
  const json off = rig.WaitFor("light", 2);
  EXPECT_EQ(off["level"], 0.0);
  EXPECT_LT(off["time_s"].get<double>() - rig.WaitFor("light")["time_s"].get<double>(), 10.0);
}

// Starts `sateen serve`, turns a light on through it, and ends the daemon with the signal.
ShellResult EndDaemonWithALightOn(const RunningRig& rig, const std::filesystem::path& folder,
                                  const std::string& signal) {
  const std::string events = (folder / "events.jsonl").string();
  const std::string socket = (folder / "s.sock").string();
  WriteText(folder / "end.sh", "export SATEEN_SOCKET=" + socket + "\n" +  //
                                   kSateen + " serve & daemon=$!\n" + "while ! test -S " + socket +
                                   "; do sleep 0.05; done\n" + kSateen + " light 5 & light=$!\n" +
                                   "while ! grep -q 'level.:0.5' " + events +
                                   "; do sleep 0.05; done\n" + "kill -" + signal + " $daemon\n" +
                                   "wait $light; echo light ended with $?\n" +
                                   "wait $daemon; echo daemon ended with $?\n");
  return Shell(rig.Environment() + "sh " + (folder / "end.sh").string());
}

TEST(RigProgram, ADaemonThatIsEndedTurnsItsLightOff) {
  const TempFolder folder;
  RunningRig rig(folder.Path());
  const ShellResult ended = EndDaemonWithALightOn(rig, folder.Path(), "TERM");
  EXPECT_THAT(ended.out, HasSubstr("cancelled by the end of the daemon"));
  EXPECT_THAT(ended.out, HasSubstr("light ended with 6"));
  EXPECT_THAT(ended.out, HasSubstr("all lights off; ended"));
  EXPECT_THAT(ended.out, HasSubstr("daemon ended with 0"));
  EXPECT_FALSE(std::filesystem::exists(folder.Path() / "s.sock"));
  EXPECT_EQ(rig.WaitFor("light", 2)["level"], 0.0);
}

TEST(RigProgram, AKilledDaemonLeavesNoLightOnAndItsSocketIsReplaced) {
  const TempFolder folder;
  RunningRig rig(folder.Path());
  const ShellResult ended = EndDaemonWithALightOn(rig, folder.Path(), "KILL");
  EXPECT_THAT(ended.out, HasSubstr("is gone"));
  EXPECT_THAT(ended.out, HasSubstr("light ended with 5"));
  EXPECT_TRUE(std::filesystem::exists(folder.Path() / "s.sock"));
  const json off = rig.WaitFor("light", 2);
  EXPECT_EQ(off["level"], 0.0);
  EXPECT_LT(off["time_s"].get<double>() - rig.WaitFor("light")["time_s"].get<double>(), 10.0);
  // The stale socket is no daemon to a command, and none in the way of the next daemon.
  const std::string at = "SATEEN_SOCKET=" + (folder.Path() / "s.sock").string() + " ";
  EXPECT_EQ(Shell(rig.Environment() + at + kSateen + " light status").exit_status, 0);
  const ShellResult next =
      Shell(rig.Environment() + at + "sh -c '" + kSateen + " serve & sleep 1; kill $!; wait $!'");
  EXPECT_EQ(next.exit_status, 0) << next.out;
  EXPECT_THAT(next.out, HasSubstr("all lights off; ended"));
}

TEST(RigProgram, SaysWhatToPasteIntoAnotherShell) {
  const ShellResult result = Shell("echo quit | " + kRig);
  EXPECT_EQ(result.exit_status, 0);
  EXPECT_THAT(result.out, HasSubstr("export LD_PRELOAD='"));
  EXPECT_THAT(result.out, HasSubstr("SATEEN_VIRTUAL_PORT='"));
}

// A daemon of the user's has the real rig.
TEST(RigProgram, ACommandUnderTheRigFindsNoDaemon) {
  const ShellResult result =
      Shell("SATEEN_SOCKET=/run/sateen/sateen.sock " + kRig + " run --rig '" + kRing +
            "' -- sh -c 'echo \"[$SATEEN_SOCKET]\"' 2>/dev/null");
  EXPECT_THAT(result.out, HasSubstr("[]"));
}

TEST(RigProgram, CommandsActOnTheBoard) {
  const TempFolder folder;
  RunningRig rig(folder.Path());
  rig.Tell("reset");
  EXPECT_EQ(rig.WaitFor("reset")["cause"], "external");
  rig.Tell("brown-out 30");
  EXPECT_EQ(rig.WaitFor("reset", 2)["cause"], "brown-out");
  const ShellResult status = Shell(rig.Environment() + kSateen + " light status");
  EXPECT_EQ(status.exit_status, 0) << status.out;
  EXPECT_THAT(status.out, HasSubstr("supply voltage"));
}

}  // namespace
}  // namespace sateen::testing::rig_program_test
