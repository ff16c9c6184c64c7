#include "cli/serve.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <cstdlib>
#include <sstream>
#include <thread>

#include "cli/devices.h"
#include "cli/light.h"
#include "scanner/daemon/http/http_client.h"
#include "tests/cli/cli_runner.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/scanner/daemon/hostile_clients.h"
#include "tests/testing/files.h"

namespace sateen::serve_test {
namespace {

using testing::FakeBoard;
using ::testing::HasSubstr;
using testing::RunResult;
using testing::TempFolder;

// `sateen serve` in a thread, over a board in simulated time.
class Serving {
 public:
  Serving() {
    rig_.held = false;
    args_.socket = folder_.Path() / "s.sock";
    setenv("SATEEN_SOCKET", args_.socket.c_str(), 1);
    thread_ = std::thread([this] {
      status_ = cli::RunServeOn(args_, rig_.Devices(), {}, {.cancel = &cancel_}, out_, log_);
    });
    while (!FindDaemon().value_or(std::nullopt)) {
      std::this_thread::yield();
    }
  }
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;
  ~Serving() {
    if (thread_.joinable()) {
      End();
    }
    unsetenv("SATEEN_SOCKET");
  }
  RunResult End() {
    cancel_ = true;
    thread_.join();
    return {.exit_status = status_, .out = out_.str(), .log = log_.str()};
  }
  [[nodiscard]] const std::filesystem::path& Socket() const { return args_.socket; }

  FakeBoard& Board() { return rig_.board; }  // once it has ended

 private:
  testing::FakeRig rig_;
  TempFolder folder_;
  cli::ServeArgs args_;
  std::atomic<bool> cancel_ = false;
  std::ostringstream out_;
  std::ostringstream log_;
  int status_ = -1;
  std::thread thread_;
};

RunResult Light(std::vector<std::string> words) {
  words.insert(words.begin(), "light");
  return testing::RunCommand<cli::LightArgs>(std::move(words), cli::AddLight, cli::RunLight);
}

RunResult Serve(std::vector<std::string> words) {
  words.insert(words.begin(), "serve");
  std::atomic<bool> cancel = true;
  return testing::RunCommand<cli::ServeArgs>(std::move(words), cli::AddServe, cli::RunServe,
                                             {.cancel = &cancel});
}

TEST(Serve, SaysWhereItListensAndEndsWithNothingLeft) {
  Serving daemon;
  EXPECT_TRUE(std::filesystem::exists(daemon.Socket()));
  const RunResult ended = daemon.End();
  EXPECT_EQ(ended.exit_status, 0) << ended.log;
  EXPECT_EQ(ended.out,
            fmt::format("listening on unix:{}\nall lights off; ended\n", daemon.Socket().string()));
  EXPECT_FALSE(std::filesystem::exists(daemon.Socket()));
}

TEST(Serve, LightGoesThroughTheDaemon) {
  Serving daemon;
  const RunResult on = Light({"3", "--level", "25%", "--for", "900ms"});
  EXPECT_EQ(on.exit_status, 0) << on.log;
  EXPECT_EQ(on.out, "light 3 on at 25 % for 900 ms\nlight 3 off\n");
  const RunResult limit = Light({"3"});
  EXPECT_EQ(limit.exit_status, 5);
  EXPECT_THAT(limit.log, HasSubstr("went off after 10 s"));
  EXPECT_EQ(Light({"off"}).out, "all lights off\n");
  EXPECT_THAT(Light({"status"}).out, HasSubstr("firmware fakefake, protocol 1.0"));
  EXPECT_EQ(Light({"status", "--json"}).Json()["schema"], "sateen.light/1");
  EXPECT_THAT(Light({"limits", "3", "--max-on", "20s"}).out, HasSubstr("20 s"));
  EXPECT_EQ(Light({"led-3"}).exit_status, 2);
  daemon.End();
  EXPECT_EQ(daemon.Board().lights_set.at(0).on_ms, 900);
  EXPECT_EQ(daemon.Board().executed[SATEEN_LIMIT_LIGHT], 1);
}

TEST(Serve, DevicesAreTheDaemons) {
  Serving daemon;
  const RunResult devices =
      testing::RunCommand<cli::DevicesArgs>({"devices"}, cli::AddDevices, cli::RunDevices);
  EXPECT_EQ(devices.exit_status, 0) << devices.log;
  EXPECT_THAT(devices.out, HasSubstr("LED board, firmware fakefake"));
}

// All connections are taken: what turns the lights off is served, everything else is told why not.
TEST(Serve, CommandsOfAFullDaemonSayWhatHappened) {
  const Serving daemon;
  const testing::Crowd crowd = testing::Attack(testing::HostileKinds(1)[1], daemon.Socket(), 64);
  const RunResult off = Light({"off"});
  EXPECT_EQ(off.exit_status, 0) << off.log;
  EXPECT_EQ(off.out, "all lights off\n");
  const RunResult devices =
      testing::RunCommand<cli::DevicesArgs>({"devices"}, cli::AddDevices, cli::RunDevices);
  EXPECT_EQ(devices.exit_status, 5);
  EXPECT_THAT(devices.log, HasSubstr("sateen devices: error: the daemon has too many clients"));
  const RunResult light = Light({"3", "--for", "900ms"});
  EXPECT_EQ(light.exit_status, 5);
  EXPECT_THAT(light.log, HasSubstr("the daemon has too many clients"));
}

TEST(Serve, ALockThatIsNoFileOfOursIsRefused) {
  const TempFolder folder;
  const std::filesystem::path socket = folder.Path() / "s.sock";
  const std::filesystem::path lock = folder.Path() / "s.sock.lock";
  const std::filesystem::path other = folder.Path() / "other";
  testing::WriteText(other, "mine");
  for (const std::filesystem::path& target : {other, folder.Path() / "none", lock}) {
    std::filesystem::create_symlink(target, lock);
    const RunResult refused = Serve({"--socket", socket.string()});
    EXPECT_EQ(refused.exit_status, 4) << target;
    EXPECT_THAT(refused.log, HasSubstr("s.sock.lock"));
    EXPECT_THAT(refused.log, HasSubstr("it is a link")) << target;
    std::filesystem::remove(lock);
  }
  EXPECT_FALSE(std::filesystem::exists(folder.Path() / "none"));
  ASSERT_EQ(mkfifo(lock.c_str(), 0600), 0);
  const RunResult fifo = Serve({"--socket", socket.string()});
  EXPECT_EQ(fifo.exit_status, 4);
  EXPECT_THAT(fifo.log, HasSubstr("is not a regular file of this user"));
  std::filesystem::remove(lock);
  EXPECT_EQ(Serve({"--socket", socket.string()}).exit_status, 0);
}

TEST(Serve, APortThatIsNamedIsOpenedByTheCommandItself) {
  const Serving daemon;
  const RunResult named = Light({"status", "--port", "/nowhere/ttyACM7"});
  EXPECT_EQ(named.exit_status, 5);
  EXPECT_THAT(named.log, HasSubstr("/nowhere/ttyACM7"));
}

TEST(Serve, TcpNeedsATokenFileOfModeSixHundred) {
  const TempFolder folder;
  const std::string socket = (folder.Path() / "s.sock").string();
  const std::string token = (folder.Path() / "token").string();
  EXPECT_EQ(Serve({"--socket", socket, "--listen", "127.0.0.1:0"}).exit_status, 2);
  testing::WriteText(token, "0123456789abcdef0123456789abcdef\n");
  const std::vector<std::string> words = {"--socket",    socket,         "--listen",
                                          "127.0.0.1:0", "--token-file", token};
  chmod(token.c_str(), 0644);
  const RunResult open = Serve(words);
  EXPECT_EQ(open.exit_status, 2);
  EXPECT_THAT(open.log, HasSubstr("chmod 600"));
  chmod(token.c_str(), 0600);
  const RunResult listening = Serve(words);
  EXPECT_EQ(listening.exit_status, 0) << listening.log;
  EXPECT_THAT(listening.out, HasSubstr("listening on http://127.0.0.1:"));
  std::vector<std::string> everybody = words;
  everybody[3] = "0.0.0.0:0";
  const RunResult refused = Serve(everybody);
  EXPECT_EQ(refused.exit_status, 2);
  EXPECT_THAT(refused.log, HasSubstr("this computer alone"));
  EXPECT_FALSE(std::filesystem::exists(socket));
}

TEST(Serve, SaysWhatToDoWhereTheSocketHasNoFolder) {
  const RunResult refused = Serve({"--socket", "/nowhere/sateen/s.sock"});
  EXPECT_EQ(refused.exit_status, 4);
  EXPECT_THAT(refused.log, HasSubstr("mkdir -p /nowhere/sateen"));
}

TEST(Serve, ASecondDaemonIsRefused) {
  Serving daemon;
  const RunResult second = Serve({"--socket", daemon.Socket().string()});
  EXPECT_EQ(second.exit_status, 5);
  EXPECT_THAT(second.log, HasSubstr("a daemon is running at"));
  EXPECT_EQ(Light({"off"}).exit_status, 0);  // the first is as it was
}

}  // namespace
}  // namespace sateen::serve_test
