#include "scanner/daemon/http/http_client.h"

#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <optional>
#include <thread>

#include "scanner/daemon/answer_json.h"
#include "scanner/daemon/http/event_parser.h"
#include "scanner/daemon/http/http_server.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/testing/files.h"

namespace sateen::http_client_test {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kLong;

class DaemonClientTest : public ::testing::Test {
 protected:
  DaemonClientTest() { setenv("SATEEN_SOCKET", Socket().c_str(), 1); }
  ~DaemonClientTest() override { unsetenv("SATEEN_SOCKET"); }
  void Serve() {
    Result<Listener> listener = Listener::OnUnixSocket(Socket());
    ASSERT_TRUE(listener) << listener.error().message;
    server_ = std::make_unique<HttpServer>(*std::move(listener), daemon_.api, daemon_.service,
                                           std::nullopt,
                                           HttpServerOptions{.heartbeat = milliseconds(50)});
  }
  [[nodiscard]] std::filesystem::path Socket() const { return folder_.Path() / "s.sock"; }

  testing::TempFolder folder_;
  testing::FakeDaemon daemon_;
  std::unique_ptr<HttpServer> server_;
  DaemonClient client_{Socket()};
};

TEST_F(DaemonClientTest, IsFoundWhereOneAnswersOnly) {
  ASSERT_TRUE(FindDaemon());
  EXPECT_FALSE(FindDaemon()->has_value());
  Serve();
  const Result<std::optional<DaemonClient>> found = FindDaemon();
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_TRUE(found->has_value());
  EXPECT_EQ((*found)->Socket(), Socket());
  setenv("SATEEN_SOCKET", "", 1);
  EXPECT_FALSE(FindDaemon()->has_value());
  setenv("SATEEN_SOCKET", Socket().c_str(), 1);
  const std::filesystem::path kept = folder_.Path() / "kept";
  std::filesystem::create_hard_link(Socket(), kept);
  server_.reset();
  std::filesystem::rename(kept, Socket());  // as a killed daemon leaves it
  EXPECT_FALSE(FindDaemon()->has_value());
}

TEST_F(DaemonClientTest, TheDefaultIsTheUsersRuntimeFolder) {
  Serve();
  unsetenv("SATEEN_SOCKET");
  setenv("XDG_RUNTIME_DIR", folder_.Path().c_str(), 1);
  EXPECT_EQ(DefaultSocketPath(), folder_.Path() / "sateen.sock");
  std::filesystem::rename(Socket(), folder_.Path() / "sateen.sock");
  EXPECT_TRUE(FindDaemon()->has_value());
  std::filesystem::rename(folder_.Path() / "sateen.sock", Socket());
  unsetenv("XDG_RUNTIME_DIR");
  EXPECT_EQ(DefaultSocketPath(), "/run/sateen/sateen.sock");
}

TEST_F(DaemonClientTest, ALightRunsToItsEnd) {
  Serve();
  daemon_.rig.held = false;
  std::vector<double> levels;
  const Result<bool> cancelled =
      KeepLightOnByDaemon(client_, {.channel = 3, .level = 0.25, .on_time = milliseconds(900)}, {},
                          [&](const LightOn& on) { levels.push_back(on.level); });
  ASSERT_TRUE(cancelled) << cancelled.error().message;
  EXPECT_FALSE(*cancelled);
  EXPECT_THAT(levels, ElementsAre(0.25));
  EXPECT_EQ(daemon_.rig.board.lights_set.at(0).on_ms, 900);
}

TEST_F(DaemonClientTest, AnErrorIsTheSameAsWithoutADaemon) {
  Serve();
  daemon_.rig.held = false;
  const LightRequest request = {.channel = 3, .name = "led-3"};  // until its limit
  const Result<bool> there = KeepLightOnByDaemon(client_, request, {}, [](const LightOn&) {});
  testing::FakeBoard fake;
  LightBoard board(std::make_unique<testing::FakePort>(fake));
  ASSERT_TRUE(board.Connect());
  const Result<bool> here = KeepLightOn(request, board, {}, [](const LightOn&) {});
  ASSERT_FALSE(there || here);
  EXPECT_EQ(there.error().code, here.error().code);
  EXPECT_EQ(there.error().message, here.error().message);
}

TEST_F(DaemonClientTest, CtrlCCancelsTheJob) {
  Serve();
  std::atomic<bool> cancel = false;
  const Result<bool> cancelled =
      KeepLightOnByDaemon(client_, {.channel = 3, .level = 0.5}, {.cancel = &cancel},
                          [&](const LightOn&) { cancel = true; });
  ASSERT_TRUE(cancelled) << cancelled.error().message;
  EXPECT_TRUE(*cancelled);
  EXPECT_TRUE(daemon_.service.WaitIdle(kLong));
  EXPECT_THAT(daemon_.rig.board.lit, IsEmpty());
}

TEST_F(DaemonClientTest, SomebodyElsesCancellingIsAnError) {
  Serve();
  const Result<bool> off =
      KeepLightOnByDaemon(client_, {.channel = 3, .level = 0.5}, {},
                          [&](const LightOn&) { EXPECT_TRUE(LightsOffByDaemon(client_)); });
  ASSERT_FALSE(off);
  EXPECT_EQ(off.error().code, ErrorCode::kCancelled);
  EXPECT_THAT(off.error().message, HasSubstr("cancelled by process"));
}

TEST_F(DaemonClientTest, ABusyRigIsExitStatus5WithWhoAndSinceWhen) {
  Serve();
  daemon_.TurnOn(3, "alice at the desk");
  for (const Result<void>& refused :
       {KeepLightOnByDaemon(client_, {.channel = 4}, {}, [](const LightOn&) {}).map([](bool) {}),
        CaptureByDaemon(client_, {.rig = "rig.json", .output = "out"}, {})
            .map([](const CaptureSummary&) {}),
        ChangeBoardByDaemon(client_, {}).map([](const BoardWord&) {}),
        DevicesByDaemon(client_).map([](const std::vector<DeviceReply>&) {})}) {
    ASSERT_FALSE(refused);
    EXPECT_EQ(ExitStatus(refused.error()), 5);
    EXPECT_THAT(refused.error().message, HasSubstr("alice at the desk since "));
  }
}

TEST_F(DaemonClientTest, ACaptureIsPostedWithAbsolutePathsAndFailsAsItWouldHere) {
  Serve();
  const Result<CaptureSummary> there =
      CaptureByDaemon(client_, {.rig = "no-rig.json", .output = folder_.Path() / "twill"}, {});
  ASSERT_FALSE(there);
  EXPECT_THAT(there.error().message,
              HasSubstr((std::filesystem::current_path() / "no-rig.json").string()));
  EXPECT_EQ(there.error().code, ErrorCode::kIo);
}

TEST_F(DaemonClientTest, ADaemonThatGoesAwayIsToldOf) {
  Serve();
  const Result<bool> gone =
      KeepLightOnByDaemon(client_, {.channel = 3, .level = 0.5}, {},
                          [&](const LightOn&) { std::thread([this] { server_.reset(); }).join(); });
  ASSERT_FALSE(gone);
  EXPECT_EQ(gone.error().code, ErrorCode::kDevice);
  EXPECT_THAT(gone.error().message, HasSubstr("is gone"));
  daemon_.service.Stop();
}

// Waits for a client: the listener itself does not block.
int AcceptOn(const Listener& listener) {
  pollfd waiting = {.fd = listener.Descriptor(), .events = POLLIN};
  EXPECT_EQ(poll(&waiting, 1, 60'000), 1);
  return accept(listener.Descriptor(), nullptr, nullptr);
}

// Killed between the question and its answer.
TEST_F(DaemonClientTest, ADaemonThatDiesWhileItIsAskedIsGone) {
  std::optional<Listener> listener(*Listener::OnUnixSocket(Socket()));
  std::thread daemon([&] {
    const int connection = AcceptOn(*listener);
    pollfd asked = {.fd = connection, .events = POLLIN};
    EXPECT_EQ(poll(&asked, 1, 60'000), 1);
    listener.reset();
    close(connection);
  });
  const Result<std::string> answer = client_.Ask("GET", "/v1/state");
  daemon.join();
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::kDevice);
  EXPECT_THAT(answer.error().message, HasSubstr("is gone"));
}

// A server that is full answers before it has read the request, and closes its end.
TEST_F(DaemonClientTest, AnAnswerThatComesBeforeTheRequestIsReadCounts) {
  const Listener listener = *Listener::OnUnixSocket(Socket());
  std::thread daemon([&] {
    const int connection = AcceptOn(listener);
    const std::string body = ErrorJson({ErrorCode::kDevice, "too many"});
    const std::string answer =
        fmt::format("HTTP/1.1 503 Busy\r\nContent-Length: {}\r\n\r\n{}", body.size(), body);
    EXPECT_EQ(write(connection, answer.data(), answer.size()), static_cast<ssize_t>(answer.size()));
    shutdown(connection, SHUT_RD);  // from now on the client gets EPIPE
    pollfd gone = {.fd = connection, .events = 0};
    EXPECT_EQ(poll(&gone, 1, 60'000), 1);
    close(connection);
  });
  const Result<std::string> answer = client_.Ask("POST", "/v1/jobs", std::string(4'000'000, ' '));
  daemon.join();
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().message, "too many");
}

// Nobody would watch its light any more.
TEST_F(DaemonClientTest, AJobThatCannotBeFollowedIsCancelled) {
  Result<Listener> listener = Listener::OnUnixSocket(Socket());
  ASSERT_TRUE(listener);
  server_ = std::make_unique<HttpServer>(*std::move(listener), daemon_.api, daemon_.service,
                                         std::nullopt, HttpServerOptions{.max_streams = 0});
  const Result<bool> refused =
      KeepLightOnByDaemon(client_, {.channel = 3, .level = 0.5}, {}, [](const LightOn&) {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("too many clients follow events"));
  ASSERT_TRUE(daemon_.service.WaitIdle(kLong));
  EXPECT_THAT(daemon_.rig.board.lit, IsEmpty());
}

TEST(EventParser, TakesEventsOutOfAnyPieces) {
  const std::string text =
      ":\n\nid: 7\nevent: progress\ndata: {\"a\": 1}\n\n: still here\n\nid: 8\nevent: done\ndata: "
      "2\n\nid: 9\nevent: cut off";
  for (std::size_t size = 1; size < text.size(); ++size) {
    std::vector<std::string> seen;
    EventParser parser([&](const JobEvent& event) {
      seen.push_back(fmt::format("{} {} {}", event.sequence, event.type, event.data));
    });
    for (std::size_t at = 0; at < text.size(); at += size) {
      parser.Add(std::string_view(text).substr(at, size));
    }
    EXPECT_THAT(seen, ElementsAre("7 progress {\"a\": 1}", "8 done 2"));
  }
}

}  // namespace
}  // namespace sateen::http_client_test
