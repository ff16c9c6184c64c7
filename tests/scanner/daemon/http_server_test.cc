#include "scanner/daemon/http/http_server.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/scanner/daemon/http_talk.h"
#include "tests/testing/files.h"

namespace sateen::http_server_test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using testing::BodyOf;
using testing::Exchange;
using ::testing::HasSubstr;
using testing::HttpRequest;
using ::testing::Not;
using testing::RawClient;
using testing::StatusOf;

const std::string kToken = "0123456789abcdef0123456789abcdef";

// A fake rig behind real sockets.
class HttpServerTest : public ::testing::Test {
 protected:
  void ServeUnix(const HttpServerOptions& options = {}) {
    Result<Listener> listener = Listener::OnUnixSocket(Socket());
    ASSERT_TRUE(listener) << listener.error().message;
    server_ = std::make_unique<HttpServer>(*std::move(listener), daemon_.api, daemon_.service,
                                           std::nullopt, options);
  }
  int ServeTcp() {
    Result<Listener> listener = Listener::OnLoopback("127.0.0.1:0");
    EXPECT_TRUE(listener) << listener.error().message;
    const int port = listener->Port();
    tcp_ = std::make_unique<HttpServer>(*std::move(listener), daemon_.api, daemon_.service,
                                        AccessRules(kToken, port));
    return port;
  }
  [[nodiscard]] std::filesystem::path Socket() const { return folder_.Path() / "s.sock"; }
  [[nodiscard]] std::string Ask(const std::string& method, const std::string& path,
                                const std::string& body = "") const {
    return Exchange(Socket(), HttpRequest(method, path, body));
  }

  testing::TempFolder folder_;
  testing::FakeDaemon daemon_;
  std::unique_ptr<HttpServer> server_;
  std::unique_ptr<HttpServer> tcp_;
};

TEST_F(HttpServerTest, AnswersOnAUnixSocketAndKnowsWhoAsks) {
  ServeUnix();
  const std::string state = Ask("GET", "/v1/state");
  EXPECT_EQ(StatusOf(state), 200) << state;
  EXPECT_THAT(state, HasSubstr("Content-Type: application/json"));
  EXPECT_THAT(state, HasSubstr("Cache-Control: no-store"));
  EXPECT_EQ(json::parse(BodyOf(state))["schema"], "sateen.state/1");
  EXPECT_EQ(StatusOf(Ask("POST", "/v1/lights/off")), 200);
  const json jobs = json::parse(BodyOf(Ask("GET", "/v1/jobs")));
  EXPECT_THAT(jobs["jobs"][0]["owner"].get<std::string>(),
              HasSubstr(fmt::format("process {}", getpid())));
  EXPECT_EQ(StatusOf(Ask("PUT", "/v1/state")), 405);
  EXPECT_THAT(Ask("PUT", "/v1/state"), HasSubstr("Allow: GET\r\n"));
  EXPECT_EQ(StatusOf(Ask("GET", "/nothing")), 404);
}

TEST_F(HttpServerTest, RefusesWhatItCannotRead) {
  ServeUnix();
  const std::string host = "Host: localhost\r\n";
  for (const auto& [bytes, status] : std::vector<std::pair<std::string, int>>{
           {"hello\r\n\r\n", 400},
           {"GET\r\n\r\n", 400},
           {"BREW /v1/state HTTP/1.1\r\n\r\n", 400},
           {"GET /v1/state HTTP/1.1\r\nbad header\r\n\r\n", 400},
           {HttpRequest("POST", "/v1/jobs", "{oops"), 400},
           {HttpRequest("GET", std::string(9000, '/')), 414},
           {HttpRequest("GET", "/v1/state", "", "Range: bytes=9-1\r\n"), 200},
           {HttpRequest("POST", "/v1/jobs", "",
                        host + fmt::format("Content-Length: {}\r\n", 64 * 1024 + 1)),
            413},
           {HttpRequest("POST", "/v1/jobs", "", host + "Content-Length: 1e3\r\n"), 400},
           {HttpRequest("POST", "/v1/jobs", "", host + "Content-Length: -1\r\n"), 400},
           {HttpRequest("POST", "/v1/jobs", "",
                        host + "Content-Length: 2\r\nContent-Length: 3\r\n"),
            400},
           {HttpRequest("POST", "/v1/jobs", "", host + "Transfer-Encoding: chunked\r\n"), 411},
           {HttpRequest("POST", "/v1/lights/3", "", host + "Content-Length: 2\r\n") + "{}", 415},
           {HttpRequest("GET", "/v1/jobs/1/events", "", host + "Last-Event-ID: x\r\n"), 400},
           // Lines that readers take for different things (RFC 9112, 5.1 and 5.2).
           {HttpRequest("POST", "/v1/jobs", "", host + "Transfer-Encoding : chunked\r\n"), 400},
           {HttpRequest("POST", "/v1/jobs", "", host + "Transfer-Encoding\t: chunked\r\n"), 400},
           {HttpRequest("POST", "/v1/jobs", "", host + "Transfer-Encoding:\r\n"), 411},
           {HttpRequest("GET", "/v1/state", "", host + "Origin : x\r\n"), 400},
           {HttpRequest("GET", "/v1/state", "", host + " Origin: x\r\n"), 400},
           {HttpRequest("GET", "/v1/state", "", host + "X: a\r\n Origin: x\r\n"), 400},
           {HttpRequest("GET", "/v1/state", "", host + ": x\r\n"), 400},
           {HttpRequest("GET", "/v1/state", "", " Host: localhost\r\n"), 400},
           {HttpRequest("GET", "/v1/state", "", "X!#$%&'*+-.^_`|~9:\r\n"), 200}}) {
    const std::string answer = Exchange(Socket(), bytes);
    EXPECT_EQ(StatusOf(answer), status) << bytes.substr(0, 100) << "\n" << answer;
    if (status != 200) {
      EXPECT_TRUE(json::accept(BodyOf(answer))) << answer;
    }
  }
  EXPECT_TRUE(daemon_.service.Jobs().empty());
}

// An oversized body that is really sent gets its answer too.
TEST_F(HttpServerTest, OversizedBodiesAreRefusedWithAnAnswer) {
  ServeUnix();
  const std::string answer = Ask("POST", "/v1/jobs", std::string(300 * 1024, ' '));
  EXPECT_EQ(StatusOf(answer), 413) << answer.substr(0, 200);
}

TEST_F(HttpServerTest, HeadersWithoutAnEndAreCutOff) {
  ServeUnix();
  std::string bytes = "GET /v1/state HTTP/1.1\r\n";
  for (int i = 0; i < 4000; ++i) {
    bytes += fmt::format("X-Header-{}: {:x>100}\r\n", i, "");
  }
  const std::string answer = Exchange(Socket(), bytes);
  EXPECT_EQ(StatusOf(answer), 400);
  const std::string ranges = Exchange(
      Socket(), HttpRequest("GET", "/v1/state", "", fmt::format("Range: bytes={:1>8000}-\r\n", 1)));
  EXPECT_NE(StatusOf(ranges), 0);
  EXPECT_EQ(StatusOf(Ask("GET", "/v1/state")), 200);
}

TEST_F(HttpServerTest, AnswersAreWholeWhateverTheClientWouldLike) {
  ServeUnix();
  const std::string answer =
      Exchange(Socket(),
               HttpRequest("GET", "/v1/state", "",
                           "Host: localhost\r\nRange: bytes=0-3\r\nAccept-Encoding: gzip, br\r\n"));
  EXPECT_EQ(StatusOf(answer), 200);
  EXPECT_TRUE(json::accept(BodyOf(answer))) << answer;
}

TEST_F(HttpServerTest, SlowClientsAreGivenUpAndHoldNobodyUp) {
  ServeUnix({.client_time = milliseconds(300)});
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 20; ++i) {
    slow.push_back(std::make_unique<RawClient>(Socket()));
    slow.back()->Send(i % 2 == 0 ? "GET /v1/st"
                                 : "POST /v1/jobs HTTP/1.1\r\nContent-Type: "
                                   "application/json\r\nContent-Length: 5\r\n\r\n{");
  }
  EXPECT_EQ(StatusOf(Ask("GET", "/v1/state")), 200);
  for (int i = 0; i < 20; ++i) {
    const std::string answer = slow[static_cast<std::size_t>(i)]->Read();  // to its end
    EXPECT_EQ(StatusOf(answer), 408) << answer;
    EXPECT_TRUE(json::accept(BodyOf(answer))) << answer;
  }
}

// One that ends its request too early is told so, and one that sent nothing is not waited for.
TEST_F(HttpServerTest, RequestsThatEndTooEarlyAre400) {
  ServeUnix({.client_time = testing::kLong});
  for (const std::string bytes :
       {"GET /v1/st", "GET /v1/state HTTP/1.1\r\n",
        "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json\r\nContent-Length: 5\r\n\r\n{"}) {
    RawClient client(Socket());
    client.Send(bytes);
    client.EndSending();
    const std::string answer = client.Read();
    EXPECT_EQ(StatusOf(answer), 400) << bytes << answer;
    EXPECT_TRUE(json::accept(BodyOf(answer))) << answer;
  }
  RawClient silent(Socket());
  silent.EndSending();
  EXPECT_EQ(silent.Read(), "");
  RawClient whole(Socket());
  whole.Send(HttpRequest("POST", "/v1/lights/off"));
  whole.EndSending();
  EXPECT_EQ(StatusOf(whole.Read()), 200);
}

// Turning the lights off does not wait for a body that it does not need.
TEST_F(HttpServerTest, LightsOffNeedsNoBody) {
  ServeUnix({.client_time = testing::kLong});
  RawClient client(Socket());
  client.Send("POST /v1/lights/off HTTP/1.1\r\nContent-Length: 60000\r\n\r\n");
  EXPECT_EQ(StatusOf(client.Read("}")), 200);
}

TEST_F(HttpServerTest, MoreConnectionsThanItsThreadsAreToldSo) {
  ServeUnix({.max_connections = 3});
  std::vector<std::unique_ptr<RawClient>> open;
  for (int i = 0; i < 3; ++i) {
    open.push_back(std::make_unique<RawClient>(Socket()));
  }
  std::string refused;
  RawClient over(Socket());
  refused = over.Read();
  EXPECT_EQ(StatusOf(refused), 503) << refused;
  open.clear();
  std::string answer;  // as soon as one has been noticed to have gone
  while (StatusOf(answer = Ask("GET", "/v1/state")) != 200) {
    std::this_thread::yield();
  }
}

TEST_F(HttpServerTest, OnTcpOnlyWithTheTokenAndOurHost) {
  const int port = ServeTcp();
  const std::string host = fmt::format("Host: localhost:{}\r\n", port);
  const std::string token = fmt::format("Authorization: Bearer {}\r\n", kToken);
  const auto ask = [&](const std::string& headers, const std::string& body = "") {
    return Exchange(port, HttpRequest("POST", "/v1/lights/off", body, headers));
  };
  EXPECT_EQ(StatusOf(ask(host + token)), 200);
  const std::size_t jobs = daemon_.service.Jobs().size();
  const std::string wrong = ask(host + "Authorization: Bearer wrong\r\n");
  EXPECT_EQ(StatusOf(wrong), 401);
  EXPECT_THAT(wrong, HasSubstr("WWW-Authenticate: Bearer"));
  EXPECT_EQ(StatusOf(ask(host)), 401);
  EXPECT_EQ(StatusOf(ask(host + token + token)), 401);
  EXPECT_EQ(StatusOf(ask("Host: evil.example\r\n" + token)), 421);
  EXPECT_EQ(StatusOf(ask(host + "Host: evil.example\r\n" + token)), 421);
  EXPECT_EQ(StatusOf(ask(host + token + "Origin: https://evil.example\r\n")), 403);
  EXPECT_EQ(StatusOf(ask(host + token + "Origin:\r\n")), 403);
  EXPECT_EQ(StatusOf(ask(host + token + "Origin: \r\n")), 403);
  EXPECT_EQ(StatusOf(ask(host + token + "oRIGIN:null\r\n")), 403);
  EXPECT_EQ(StatusOf(ask(host + token + "Origin : https://evil.example\r\n")), 400);
  // Before its body is read: what is refused learns nothing.
  EXPECT_EQ(StatusOf(ask(host, std::string(100'000, ' '))), 401);
  EXPECT_EQ(StatusOf(Exchange(port, HttpRequest("GET", "/v1/nothing", "", host))), 401);
  EXPECT_EQ(daemon_.service.Jobs().size(), jobs);
}

TEST_F(HttpServerTest, EventsComeAsTheyHappenAndAreResumed) {
  ServeUnix();
  std::atomic<int> step = 0;
  const auto id =
      daemon_.service.Begin(testing::WorkJob([&](JobContext& job) -> Result<std::string> {
        job.Report("\"one\"");
        while (step < 1) {
          std::this_thread::yield();
        }
        job.Report("\"two\"");
        return "\"end\"";
      }));
  const std::string path = fmt::format("/v1/jobs/{}/events", *id);
  RawClient follower(Socket());
  follower.Send(HttpRequest("GET", path));
  const std::string begun = follower.Read("\"one\"");
  EXPECT_THAT(begun, HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(begun, HasSubstr("id: 1\nevent: progress\ndata: \"one\"\n\n"));
  EXPECT_THAT(begun, Not(HasSubstr("two")));
  step = 1;
  EXPECT_THAT(follower.Read(), HasSubstr("id: 3\nevent: done\ndata: \"end\"\n\n"));

  const std::string resumed =
      Exchange(Socket(), HttpRequest("GET", path, "", "Host: localhost\r\nLast-Event-ID: 1\r\n"));
  EXPECT_THAT(resumed, Not(HasSubstr("\"one\"")));
  EXPECT_THAT(resumed, HasSubstr("id: 2\nevent: progress"));
  EXPECT_THAT(resumed, HasSubstr("id: 3\nevent: done"));
}

TEST_F(HttpServerTest, AStreamSaysThatItIsThereAndOthersAreServedMeanwhile) {
  ServeUnix({.heartbeat = milliseconds(20), .max_streams = 1});
  const std::uint64_t id = daemon_.TurnOn(3);
  const std::string path = fmt::format("/v1/jobs/{}/events", id);
  RawClient follower(Socket());
  follower.Send(HttpRequest("GET", path));
  follower.Read(":\n\n");
  EXPECT_EQ(StatusOf(Ask("GET", path)), 503);
  EXPECT_EQ(StatusOf(Ask("POST", "/v1/lights/4", "{}")), 409);
  EXPECT_EQ(StatusOf(Ask("DELETE", fmt::format("/v1/jobs/{}", id))), 202);
  EXPECT_THAT(follower.Read(), HasSubstr("event: failed"));
  // The stream that ended made room.
  EXPECT_THAT(Ask("GET", path), HasSubstr("event: failed"));
}

TEST_F(HttpServerTest, ItsEndEndsEveryConnection) {
  ServeUnix({.heartbeat = milliseconds(20)});
  const std::uint64_t id = daemon_.TurnOn(3);
  RawClient follower(Socket());
  follower.Send(HttpRequest("GET", fmt::format("/v1/jobs/{}/events", id)));
  follower.Read("progress");
  RawClient idle(Socket());
  idle.Send("GET /v1/state HTTP/1.1\r\n");
  server_.reset();
  EXPECT_FALSE(std::filesystem::exists(Socket()));
  follower.Read();
  idle.Read();
  daemon_.service.Stop();
  EXPECT_TRUE(daemon_.rig.board.lit.empty());
}

}  // namespace
}  // namespace sateen::http_server_test
