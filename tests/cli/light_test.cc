#include "cli/light.h"

#include <gmock/gmock.h>

#include <atomic>
#include <sstream>

#include "tests/cli/cli_runner.h"
#include "tests/scanner/devices/fake_board.h"
#include "tests/testing/places.h"

namespace sateen::light_test {
namespace {

using testing::FakeBoard;
using testing::FakePort;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::RunResult;
using ::testing::SizeIs;

// Runs `sateen light ...` against a board in simulated time.
RunResult Light(FakeBoard& fake, std::vector<std::string> words, const Task& task = {},
                std::function<void()> on_wait = {}) {
  words.insert(words.begin(), "light");
  const auto run = [&](const cli::LightArgs& args, const Task& with, std::ostream& out,
                       std::ostream& log) {
    auto port = std::make_unique<FakePort>(fake);
    port->on_wait = std::move(on_wait);
    return cli::RunLightOn(args, std::move(port), with, out, log);
  };
  return testing::RunCommand<cli::LightArgs>(std::move(words), cli::AddLight, run, task);
}

TEST(Light, IsOnForAsLongAsAsked) {
  FakeBoard fake;
  const RunResult result = Light(fake, {"3", "--level", "50%", "--for", "5s"});
  EXPECT_EQ(result.exit_status, 0) << result.log;
  ASSERT_THAT(fake.lights_set, SizeIs(1));
  EXPECT_EQ(fake.lights_set[0].channel, 3);
  EXPECT_EQ(fake.lights_set[0].level_permille, 500);
  EXPECT_EQ(fake.lights_set[0].on_ms, 5000);
  // Longer than the 2 s after which a board that hears nothing turns it off.
  EXPECT_GE(fake.now, std::chrono::seconds(5));
  EXPECT_EQ(result.out, "light 3 on at 50 % for 5 s\nlight 3 off\n");
}

TEST(Light, CtrlCTurnsItOff) {
  FakeBoard fake;
  std::atomic<bool> cancel = false;
  std::set<int> lit_before;
  const RunResult result = Light(fake, {"7"}, {.cancel = &cancel}, [&] {
    if (fake.now > std::chrono::seconds(3)) {
      lit_before = fake.lit;
      cancel = true;
    }
  });
  EXPECT_EQ(result.exit_status, 0) << result.log;
  EXPECT_THAT(lit_before, ::testing::ElementsAre(7));
  EXPECT_THAT(fake.lit, IsEmpty());
}

TEST(Light, ThatReachesItsLimitIsAnError) {
  FakeBoard fake;
  const RunResult result = Light(fake, {"3"});
  EXPECT_EQ(result.exit_status, 5);
  EXPECT_THAT(result.log, HasSubstr("went off after 10 s"));
  EXPECT_THAT(result.log, HasSubstr("limits 3 --max-on"));
}

TEST(Light, IsFoundByItsNameInTheRig) {
  FakeBoard fake;
  const std::string rig = testing::SourceDir() + "/samples/rigs/ring10.json";
  EXPECT_EQ(Light(fake, {"led-4", "--rig", rig, "--for", "1s"}).exit_status, 0);
  EXPECT_EQ(fake.lights_set.at(0).channel, 4);
  FakeBoard untouched;  // an Uno restarts when its port is opened
  const RunResult unknown = Light(untouched, {"led-44", "--rig", rig});
  EXPECT_EQ(unknown.exit_status, 2);
  EXPECT_THAT(unknown.log, HasSubstr("has no light 'led-44'"));
  EXPECT_THAT(Light(untouched, {"led-4"}).log, HasSubstr("--rig"));
  EXPECT_THAT(Light(untouched, {"limits", "off", "--max-on", "1s"}).log, HasSubstr("--rig"));
  EXPECT_EQ(untouched.opened, 0);
}

TEST(Light, WrongCommandLinesTouchNoPort) {
  FakeBoard fake;
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{},
                                             {"3", "--level", "150%"},
                                             {"3", "--for", "5"},
                                             {"3", "--max-on", "5s"},
                                             {"3", "--json"},
                                             {"off", "--clear-fault"},
                                             {"limits", "--dim", "1kHz"},
                                             {"3", "4"}}) {
    EXPECT_EQ(Light(fake, words).exit_status, 2);
  }
  EXPECT_EQ(fake.opened, 0);
}

TEST(Light, OffAndStatus) {
  FakeBoard fake;
  fake.lit = {5};
  EXPECT_EQ(Light(fake, {"off"}).out, "all lights off\n");
  EXPECT_THAT(fake.lit, IsEmpty());
  const RunResult text = Light(fake, {"status"});
  EXPECT_THAT(text.out, HasSubstr("firmware fakefake, protocol 1.0"));
  EXPECT_THAT(text.out, HasSubstr("on: none"));
  const nlohmann::json json = Light(fake, {"status", "--json"}).Json();
  EXPECT_EQ(json["schema"], "sateen.light/1");
  EXPECT_EQ(json["limits"].size(), 14u);
  EXPECT_EQ(json["state"]["lit"], nlohmann::json::array());
}

TEST(Light, LimitsAreSetForOneLightOrForAll) {
  FakeBoard fake;
  const RunResult one = Light(fake, {"limits", "3", "--max-level", "80%", "--max-on", "20s"});
  EXPECT_EQ(one.exit_status, 0) << one.log;
  EXPECT_EQ(fake.executed[SATEEN_LIMIT_LIGHT], 1);
  EXPECT_THAT(one.out, HasSubstr("    3       80 %         20 s"));
  EXPECT_EQ(Light(fake, {"limits", "--max-on", "20s"}).exit_status, 0);
  EXPECT_EQ(fake.executed[SATEEN_LIMIT_LIGHT], 15);
  EXPECT_EQ(fake.executed[SATEEN_CONFIGURE], 0);
  const RunResult board = Light(fake, {"limits", "--dim", "2kHz", "--sync", "rising"});
  EXPECT_EQ(fake.executed[SATEEN_CONFIGURE], 1);
  EXPECT_THAT(board.out, HasSubstr("dimming line: 2kHz; flash sync: rising edge"));
}

TEST(Light, NoBoardIsExitStatus5) {
  FakeBoard fake;
  fake.plugged = false;
  const RunResult result = Light(fake, {"status"});
  EXPECT_EQ(result.exit_status, 5);
  EXPECT_THAT(result.log, HasSubstr("sateen light: error: fake: not there"));
}

TEST(Light, ABoardThatIsUnpluggedIsExitStatus5) {
  FakeBoard fake;
  const RunResult result = Light(fake, {"3"}, {}, [&] {
    if (fake.now > std::chrono::seconds(1)) {
      fake.Unplug();
    }
  });
  EXPECT_EQ(result.exit_status, 5);
  EXPECT_THAT(result.log, HasSubstr("the port is gone"));
}

}  // namespace
}  // namespace sateen::light_test
