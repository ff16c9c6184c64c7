#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "cli/capture.h"
#include "cli/devices.h"
#include "cli/light.h"
#include "scanner/daemon/api.h"
#include "scanner/daemon/rig_service.h"
#include "tests/cli/cli_runner.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"
#include "tests/simulation/virtual_rig/lying_port.h"

// Whatever a board says, nobody is told "off" or "done" where its word is otherwise.
namespace sateen::testing::lying_board_test {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::chrono::milliseconds kLong{60'000};

class LyingBoard : public ::testing::TestWithParam<size_t> {
 protected:
  LyingBoard() : lie_(Lies().at(GetParam())) {}

  // A new board that lies, whose host was told nothing yet.
  std::unique_ptr<LyingPort> NewPort(Lie lie) {
    auto board = VirtualBoard::Load(Firmware(), ControllerWiring());
    EXPECT_TRUE(board) << board.error().message;
    board_ = *std::move(board);
    board_->RunFor(milliseconds(20));
    told_ = {};
    return std::make_unique<LyingPort>(*board_, std::move(lie), told_);
  }
  std::unique_ptr<LyingPort> NewPort() { return NewPort(lie_); }

  std::unique_ptr<RigDevices> NewDevices(Lie lie) {
    auto port = NewPort(std::move(lie));
    return std::make_unique<RigDevices>(std::move(port),
                                        std::make_unique<LitCamera>(*board_, LightImages(rig_)));
  }

  RunResult Light(std::vector<std::string> words) {
    words.insert(words.begin(), "light");
    return RunCommand<cli::LightArgs>(
        std::move(words), cli::AddLight,
        [&](const cli::LightArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
          return cli::RunLightOn(args, NewPort(), task, out, log);
        });
  }

  RunResult Capture(Lie lie, const std::string& name) {
    const std::string rig_file = temp_.Path() / "rig.json";
    WriteText(rig_file, RigToJson(rig_));
    return RunCommand<cli::CaptureArgs>(
        {"capture", "--rig", rig_file, "-o", temp_.Path() / name, "--exposure", "20ms", "--settle",
         "5ms", "--tries", "1"},
        cli::AddCapture,
        [&](const cli::CaptureArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
          cli::CaptureArgs quiet = args;
          quiet.request.options.keep_alive = milliseconds(0);
          return cli::RunCaptureWith(quiet, *NewDevices(std::move(lie)), task, out, log);
        },
        {.threads = 1});
  }

  // Holds whenever the host was lied to.
  void ExpectNotBelieved(const RunResult& run, const std::string& use) {
    if (told_.lies > 0) {
      EXPECT_EQ(run.exit_status, 5) << use << ": " << run.out << run.log;
      EXPECT_THAT(run.out, Not(AnyOf(HasSubstr("off\n"), HasSubstr("complete")))) << use;
      EXPECT_THAT(run.log, Not(HasSubstr("the lights are off"))) << use;
    } else {
      EXPECT_EQ(run.exit_status, 0) << use << ": " << run.log;
    }
  }

  Lie lie_;
  Rig rig_ = CaptureRig();
  TempFolder temp_;
  std::unique_ptr<VirtualBoard> board_;
  Told told_;
};

TEST_P(LyingBoard, IsNotBelievedByLight) {
  SCOPED_TRACE(lie_.name);
  ExpectNotBelieved(Light({"3", "--level", "50%", "--for", "600ms"}), "light 3");
  ExpectNotBelieved(Light({"3", "--level", "0%"}), "light 3 at 0 %");
  ExpectNotBelieved(Light({"off"}), "light off");
  ExpectNotBelieved(Light({"limits", "3", "--max-on", "5s"}), "light limits");
  const RunResult status = Light({"status"});
  if (status.exit_status == 0) {
    const std::string lit =
        told_.last->lit == 0
            ? "on: none"
            : "on: " + std::to_string([&] { return LitChannels(told_.last->lit).front(); }());
    EXPECT_THAT(status.out, HasSubstr(lit));
  }
}

TEST_P(LyingBoard, IsNotBelievedByDevices) {
  SCOPED_TRACE(lie_.name);
  const std::vector<SerialPortInfo> ports = {{.name = "/dev/ttyACM0", .may_be_board = true}};
  const RunResult devices = RunCommand<cli::DevicesArgs>(
      {"devices"}, cli::AddDevices,
      [&](const cli::DevicesArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
        return cli::RunDevicesAmong(
            args, ports, [&](const std::string&) { return NewPort(); }, task, out, log);
      });
  const bool off = told_.last && told_.last->lit == 0 && told_.last->result == 0;
  if (!off) {
    EXPECT_EQ(devices.exit_status, 5) << devices.out;
    EXPECT_THAT(devices.out, Not(HasSubstr("LED board, firmware")));
  }
}

TEST_P(LyingBoard, IsNotBelievedByCapture) {
  SCOPED_TRACE(lie_.name);
  ExpectNotBelieved(Capture(lie_, "session"), "capture");
  EXPECT_EQ(std::filesystem::exists(temp_.Path() / "session/session.json"), told_.lies == 0);
}

TEST_P(LyingBoard, IsNotBelievedByTheDaemon) {
  SCOPED_TRACE(lie_.name);
  using Use = std::pair<std::string, std::string>;
  for (const Use& use : {Use("/v1/lights/off", ""), Use("/v1/board", "{}"),
                         Use("/v1/board", R"({"channel":3,"max_on_ms":5000})"),
                         Use("/v1/lights/3", R"({"level":0.5,"for_ms":600})")}) {
    const auto service = std::make_unique<RigService>(NewDevices(lie_));
    const Api api(*service, {.version = "1.2.3"});
    const ApiResponse answer =
        api.Handle({.method = "POST", .path = use.first, .body = use.second, .who = "a test"});
    ASSERT_TRUE(service->WaitIdle(kLong));
    const RigState state = service->State();
    if (told_.lies > 0) {
      const bool failed = state.last_job && state.last_job->state == JobState::kFailed;
      // Settings are what the board was asked for, and /v1/board shows its state; no word at the end
      // of a job is no word that a light is on.
      const bool shown = use.first == "/v1/board" && told_.last && state.lights_fault.empty();
      const bool unconfirmed = lie_.swallow && !state.lights_fault.empty();
      EXPECT_TRUE(failed || shown || unconfirmed) << use.first << ": " << answer.body;
    } else {
      EXPECT_THAT(answer.status, AnyOf(200, 202)) << use.first << ": " << answer.body;
      EXPECT_EQ(state.lights_fault, "") << use.first;
    }
    if (told_.last && told_.last->lit != 0) {
      EXPECT_NE(state.lights_fault, "") << use.first << ": " << answer.body;
      EXPECT_EQ(state.lit, LitChannels(told_.last->lit)) << use.first;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, LyingBoard, ::testing::Range<size_t>(0, Lies().size()));

// The very last answer of a capture, and of each job of the daemon: everything is done, and a light
// stays on.
class LastWord : public LyingBoard {};

TEST_P(LastWord, IsWhatCaptureGoesBy) {
  ASSERT_EQ(Capture({}, "honest").exit_status, 0);
  Lie lie{"the last one", {}, lie_.state, SATEEN_ALL_OFF, told_.all_off - 1};
  const RunResult run = Capture(lie, "session");
  EXPECT_EQ(told_.lies, 1);
  ExpectNotBelieved(run, "capture");
}

TEST_P(LastWord, IsWhatTheDaemonGoesBy) {
  // The first all off is of the job itself, the later ones are of its end.
  RigService service(NewDevices({"the last ones", {}, lie_.state, SATEEN_ALL_OFF, 1}));
  const Api api(service, {.version = "1.2.3"});
  const ApiResponse answer =
      api.Handle({.method = "POST", .path = "/v1/lights/off", .body = "", .who = "a test"});
  EXPECT_NE(answer.status, 200) << answer.body;
  EXPECT_EQ(service.State().last_job->state, JobState::kFailed);
  EXPECT_THAT(api.Handle({.method = "GET", .path = "/v1/state", .who = "a test"}).body,
              HasSubstr(R"("lit":[5])"));
}

INSTANTIATE_TEST_SUITE_P(LightFive, LastWord, ::testing::Values(15));

}  // namespace
}  // namespace sateen::testing::lying_board_test
