#include "cli/devices.h"

#include <gmock/gmock.h>

#include "tests/cli/cli_runner.h"
#include "tests/scanner/devices/fake_board.h"
#include "tests/testing/files.h"

namespace sateen::devices_test {
namespace {

using testing::FakeBoard;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::RunResult;

const std::vector<SerialPortInfo> kPorts = {{.name = "/dev/ttyACM0",
                                             .description = "Arduino Uno R3",
                                             .usb = SerialPortInfo::UsbId{0x2341, 0x0043},
                                             .may_be_board = true},
                                            {.name = "/dev/ttyS0", .description = "ttyS0"}};

RunResult Devices(FakeBoard& fake, const std::vector<SerialPortInfo>& ports,
                  std::vector<std::string> words = {}) {
  words.insert(words.begin(), "devices");
  const auto run = [&](const cli::DevicesArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log) {
    return cli::RunDevicesAmong(
        args, ports, [&](const std::string&) { return std::make_unique<testing::FakePort>(fake); },
        task, out, log);
  };
  return testing::RunCommand<cli::DevicesArgs>(std::move(words), cli::AddDevices, run);
}

TEST(Devices, AsksOnlyWhatMayBeABoard) {
  FakeBoard fake;
  const RunResult result = Devices(fake, kPorts);
  EXPECT_EQ(result.exit_status, 0) << result.log;
  EXPECT_EQ(fake.opened, 1);
  EXPECT_THAT(result.out, HasSubstr("2341:0043"));
  EXPECT_THAT(result.out, HasSubstr("LED board, firmware fakefake, protocol 1.0, 14 lights"));
  EXPECT_THAT(result.out, HasSubstr("not asked"));
}

TEST(Devices, ANamedPortIsAskedWhateverItIs) {
  FakeBoard fake;
  EXPECT_EQ(Devices(fake, kPorts, {"--port", "/dev/ttyS0"}).exit_status, 0);
  EXPECT_EQ(fake.opened, 2);
  const nlohmann::json json = Devices(fake, {}, {"--port", "/dev/pts/3", "--json"}).Json();
  EXPECT_EQ(json["schema"], "sateen.devices/1");
  EXPECT_EQ(json["devices"][0]["port"], "/dev/pts/3");
  EXPECT_EQ(json["devices"][0]["kind"], "led-board");
  EXPECT_EQ(json["devices"][0]["lights"], 14);
}

TEST(Devices, NoBoardIsExitStatus5AndSaysWhatToDo) {
  FakeBoard fake;
  fake.mute = 1000;
  const RunResult silent = Devices(fake, kPorts);
  EXPECT_EQ(silent.exit_status, 5);
  EXPECT_THAT(silent.out, HasSubstr("no greeting"));
  EXPECT_THAT(silent.log, HasSubstr("no LED board answered"));
  EXPECT_THAT(silent.log, HasSubstr("make flash"));
  const RunResult none = Devices(fake, {});
  EXPECT_EQ(none.exit_status, 5);
  EXPECT_THAT(none.log, HasSubstr("no LED board among 0 serial ports"));
}

TEST(Devices, CamerasAreListedWithWhatIsMissing) {
  FakeBoard fake;
  const testing::TempFolder folder;
  const std::string drop = "folder:" + folder.Path().string();
  const nlohmann::json json = Devices(fake, kPorts, {"--camera", drop, "--json"}).Json();
  ASSERT_EQ(json["devices"].size(), 3U);
  EXPECT_EQ(json["devices"][2]["kind"], "camera");
  EXPECT_EQ(json["devices"][2]["ready"], true);
  EXPECT_EQ(json["devices"][2]["profile"], "folder");
  const RunResult wrong = Devices(fake, kPorts, {"--camera", "dslr"});
  EXPECT_EQ(wrong.exit_status, 0);
  EXPECT_THAT(wrong.out, HasSubstr("'dslr' is not a camera"));
  EXPECT_THAT(Devices(fake, kPorts).out, HasSubstr("no camera"));
  const auto with_obstacle = [&](const cli::DevicesArgs& args, const Task& task, std::ostream& out,
                                 std::ostream& log) {
    return cli::RunDevicesAmong(
        args, kPorts, [&](const std::string&) { return std::make_unique<testing::FakePort>(fake); },
        task, out, log,
        {{.port = "usb:001,007", .description = "NIKON D5100", .obstacle = "held by gvfs"}});
  };
  const RunResult held =
      testing::RunCommand<cli::DevicesArgs>({"devices"}, cli::AddDevices, with_obstacle);
  EXPECT_THAT(held.out, HasSubstr("usb:001,007    -         NIKON D5100"));
  EXPECT_THAT(held.out, HasSubstr("held by gvfs"));
}

}  // namespace
}  // namespace sateen::devices_test
