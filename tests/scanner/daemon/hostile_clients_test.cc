#include "tests/scanner/daemon/hostile_clients.h"

#include <gmock/gmock.h>

#include <optional>

#include "scanner/daemon/http/http_server.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/testing/files.h"

namespace sateen::hostile_clients_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::Attack;
using testing::BodyOf;
using testing::Crowd;
using testing::Exchange;
using ::testing::HasSubstr;
using testing::HttpRequest;
using ::testing::IsEmpty;
using testing::kSoon;
using testing::RawClient;
using testing::StatusOf;

constexpr int kMore = 70;  // than the 64 connections that there are

class HostileClientsTest : public ::testing::Test {
 protected:
  HostileClientsTest() { Serve({.client_time = seconds(60)}); }
  void Serve(const HttpServerOptions& options) {
    server_.reset();
    server_ = std::make_unique<HttpServer>(*Listener::OnUnixSocket(Socket()), daemon_.api,
                                           daemon_.service, std::nullopt, options);
  }
  [[nodiscard]] std::filesystem::path Socket() const { return folder_.Path() / "s.sock"; }

  testing::TempFolder folder_;
  testing::FakeDaemon daemon_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HostileClientsTest, LightsOffIsServedWhateverTheOthersDo) {
  for (std::size_t k = 0; k < testing::HostileKinds(1).size(); ++k) {
    const std::uint64_t job = daemon_.TurnOn(3);
    const testing::HostileKind kind = testing::HostileKinds(job)[k];
    const Crowd crowd = Attack(kind, Socket(), kMore);

    const testing::TimedAnswer off =
        testing::TimedExchange(Socket(), HttpRequest("POST", "/v1/lights/off"));

    EXPECT_EQ(StatusOf(off.text), 200) << kind.name << off.text;
    EXPECT_LT(off.time, kSoon) << kind.name;
    EXPECT_THAT(daemon_.rig.board.lit, IsEmpty()) << kind.name;
    const std::string state = Exchange(Socket(), HttpRequest("GET", "/v1/state"));
    EXPECT_TRUE(testing::IsWholeAnswer(state)) << kind.name << state;
    if (kind.stays) {
      EXPECT_EQ(StatusOf(state), 503) << kind.name;
      EXPECT_THAT(BodyOf(state), HasSubstr("too many clients")) << kind.name;
    }
    Serve({.client_time = seconds(60)});
  }
}

// What is still being sent does not take the answer away.
TEST_F(HostileClientsTest, AClientTooManyIsToldWithABodyHoweverMuchItSends) {
  const Crowd crowd = Attack(testing::HostileKinds(1)[0], Socket(), 64);
  const std::string answer =
      Exchange(Socket(), HttpRequest("POST", "/v1/jobs", std::string(500'000, ' ')));
  EXPECT_EQ(StatusOf(answer), 503) << answer;
  EXPECT_TRUE(nlohmann::json::accept(BodyOf(answer))) << answer;
  RawClient silent(Socket());
  EXPECT_EQ(StatusOf(silent.Read()), 503);
  RawClient half(Socket());
  half.Send("GET /v1/state HTT");
  half.EndSending();
  EXPECT_EQ(StatusOf(half.Read()), 503);
}

// More than the waiting room holds: who comes now is heard all the same.
TEST_F(HostileClientsTest, ACrowdInTheWaitingRoomIsNotWaitedFor) {
  daemon_.TurnOn(3);
  const Crowd crowd = Attack(testing::HostileKinds(1)[1], Socket(), 300);
  const testing::TimedAnswer off =
      testing::TimedExchange(Socket(), HttpRequest("POST", "/v1/lights/off"));
  EXPECT_EQ(StatusOf(off.text), 200) << off.text;
  EXPECT_LT(off.time, kSoon);
}

// The way in without a token cannot take the threads that are kept for lights/off.
TEST_F(HostileClientsTest, WithoutATokenLightsOffIsNotUrgent) {
  Result<Listener> listener = Listener::OnLoopback("127.0.0.1:0");
  ASSERT_TRUE(listener);
  const int port = listener->Port();
  const std::string token = "0123456789abcdef0123456789abcdef";
  const HttpServer tcp(*std::move(listener), daemon_.api, daemon_.service, AccessRules(token, port),
                       {.max_connections = 1});
  const RawClient only(port);
  const std::string host = fmt::format("Host: localhost:{}\r\n", port);
  EXPECT_EQ(StatusOf(Exchange(port, HttpRequest("POST", "/v1/lights/off", "", host))), 503);
  EXPECT_TRUE(daemon_.service.Jobs().empty());
  EXPECT_EQ(StatusOf(Exchange(port, HttpRequest("POST", "/v1/lights/off", "",
                                                host + "Authorization: Bearer " + token + "\r\n"))),
            200);
}

// The light that they wait for is on until somebody turns it off.
TEST_F(HostileClientsTest, AClientThatHasLeftFreesItsConnection) {
  Serve({.client_time = seconds(60), .heartbeat = seconds(60), .max_connections = 2});
  const std::uint64_t job = daemon_.TurnOn(3);
  const std::string follow = HttpRequest("GET", fmt::format("/v1/jobs/{}/events", job));
  for (int round = 0; round < 3; ++round) {
    std::string answer;
    while (StatusOf(answer) != 200) {  // until those of the round before are noticed to have gone
      RawClient first(Socket());
      first.Send(follow);
      answer = first.Read("progress");
    }
  }
  EXPECT_TRUE(daemon_.service.State().job.has_value());
}

// A job that its client only waits for is not worth having without it.
TEST_F(HostileClientsTest, TheJobOfAClientThatHasLeftIsCancelled) {
  std::atomic<bool> left = false;
  const auto ended =
      daemon_.service.RunToEnd(testing::WorkJob([&](JobContext& job) -> Result<std::string> {
                                 left = true;
                                 while (!job.GetTask().Cancelled()) {
                                   std::this_thread::yield();
                                 }
                                 return tl::unexpected(job.GetTask().CheckCancelled().error());
                               }),
                               [&] { return left.load(); });
  ASSERT_TRUE(ended.has_value());
  ASSERT_TRUE(daemon_.service.WaitIdle(testing::kLong));
  EXPECT_THAT(daemon_.service.Find(ended->id)->error->message, HasSubstr("who has left"));
}

TEST_F(HostileClientsTest, TheEndWaitsForNobodyWhoIsStillAsking) {
  const Crowd slow = Attack(testing::HostileKinds(1)[1], Socket(), 200);
  const auto start = std::chrono::steady_clock::now();
  daemon_.service.Stop();
  server_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - start, kSoon);
}

}  // namespace
}  // namespace sateen::hostile_clients_test
