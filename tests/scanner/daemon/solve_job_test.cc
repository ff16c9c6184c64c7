#include "scanner/daemon/solve_job.h"

#include <gmock/gmock.h>

#include <atomic>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "core/files/file_io.h"
#include "pipelines/simulate/simulate.h"
#include "rig/rig.h"
#include "scanner/daemon/http/http_server.h"
#include "simulation/rigs.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/scanner/daemon/http_talk.h"
#include "tests/testing/files.h"

namespace sateen::solve_job_test {
namespace {

using nlohmann::json;
using testing::BodyOf;
using testing::Exchange;
using ::testing::HasSubstr;
using testing::HttpRequest;
using testing::kLong;
using testing::StatusOf;
using testing::WriteText;

constexpr const char* kScene = R"({
  "schema": "sateen.scene/1", "rig": "rig.json",
  "surface": {"shape": "sphere", "radius_mm": 240, "edge_deg": 30},
  "materials": {"surface": {"albedo": [0.6, 0.5, 0.4]}}})";

// A daemon with a fake rig behind its real socket, and a small session to solve.
class SolveJobTest : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteText(Path("rig.json"), RigToJson(RingRig({48, 32}, LightModel::kNear, 200.0)));
    WriteText(Path("scene.json"), kScene);
    const Result<SceneFile> scene = SimulateSession({.scene = Path("scene.json"),
                                                     .output = Path("session"),
                                                     .format = FrameFormat::kLinearExr});
    ASSERT_TRUE(scene) << scene.error().message;
    Result<Listener> listener = Listener::OnUnixSocket(Path("s.sock"));
    ASSERT_TRUE(listener) << listener.error().message;
    server_ = std::make_unique<HttpServer>(*std::move(listener), daemon_.api, daemon_.service,
                                           std::nullopt);
  }

  [[nodiscard]] std::filesystem::path Path(const std::string& name) const {
    return folder_.Path() / name;
  }
  [[nodiscard]] json Request() const {
    return {{"kind", "solve"},
            {"client", "photo desk"},
            {"capture", Path("session").string()},
            {"output", Path("maps").string()}};
  }
  [[nodiscard]] std::string Post(const json& request) const {
    return Exchange(Path("s.sock"), HttpRequest("POST", "/v1/jobs", request.dump()));
  }

  testing::TempFolder folder_;
  testing::FakeDaemon daemon_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(SolveJobTest, SolvesASessionAndAnswersWithSolveJson) {
  json request = Request();
  request["robust"] = "least-squares";
  request["normal_y"] = "down";
  request["lights"] = {0, 2, 4, 6, 8};
  request["threads"] = 1;

  const std::string begun = Post(request);

  ASSERT_EQ(StatusOf(begun), 202) << begun;
  const std::string events =
      Exchange(Path("s.sock"),
               HttpRequest("GET", json::parse(BodyOf(begun)).at("events").get<std::string>()));
  EXPECT_THAT(events, HasSubstr("event: progress\ndata: {\"stage\":\""));
  EXPECT_THAT(events, HasSubstr("event: done\ndata: {"));
  const json job = json::parse(BodyOf(Exchange(Path("s.sock"), HttpRequest("GET", "/v1/jobs/1"))));
  EXPECT_EQ(job.at("kind"), "solve");
  EXPECT_EQ(job.at("what"), Path("session").string());
  EXPECT_THAT(job.at("owner").get<std::string>(), HasSubstr("photo desk (process "));
  const json report = job.at("result");
  EXPECT_EQ(report, json::parse(ReadFileBytes(Path("maps/solve.json")).value()));
  EXPECT_EQ(report.at("schema"), "sateen.solve/1");
  EXPECT_EQ(report.at("solved"), 48 * 32);
  EXPECT_EQ(report.at("threads"), 1);
  EXPECT_EQ(report.at("lights"), 5);
  EXPECT_EQ(report.at("options").at("robust"), "least-squares");
  EXPECT_EQ(report.at("options").at("normal_y"), "down");
  EXPECT_TRUE(std::filesystem::exists(Path("maps/normal.exr")));
}

TEST_F(SolveJobTest, AFailedSolveTellsItsErrorAndWritesNothing) {
  json request = Request();
  request["capture"] = Path("no-session").string();

  ASSERT_EQ(StatusOf(Post(request)), 202);
  const std::string events = Exchange(Path("s.sock"), HttpRequest("GET", "/v1/jobs/1/events"));

  EXPECT_THAT(events, HasSubstr("event: failed\ndata: {\"error\":{\"code\":\"io\""));
  EXPECT_THAT(events, HasSubstr("no-session"));
  EXPECT_FALSE(std::filesystem::exists(Path("maps")));
}

TEST_F(SolveJobTest, AWrongRequestIs400WithTheKey) {
  for (const auto& [key, value] :
       std::vector<std::pair<const char*, json>>{{"capture", "session"},
                                                 {"output", ""},
                                                 {"robust", "l1"},
                                                 {"backend", 4},
                                                 {"lights", {0.5}},
                                                 {"threads", -1},
                                                 {"clip_level", 2},
                                                 {"fail_above_deg", 0},
                                                 {"rig_file", "/rig.json"}}) {
    json request = Request();
    request[key] = value;
    const std::string answer = Post(request);
    EXPECT_EQ(StatusOf(answer), 400) << key << ": " << answer;
    EXPECT_THAT(answer, HasSubstr(key));
  }
  EXPECT_EQ(Exchange(Path("s.sock"), HttpRequest("GET", "/v1/jobs/1")).find("HTTP/1.1 404"), 0U);
}

TEST_F(SolveJobTest, OnTcpItNeedsTheToken) {
  const std::string token = "0123456789abcdef0123456789abcdef";
  Result<Listener> listener = Listener::OnLoopback("127.0.0.1:0");
  ASSERT_TRUE(listener) << listener.error().message;
  const int port = listener->Port();
  const HttpServer tcp(*std::move(listener), daemon_.api, daemon_.service,
                       AccessRules(token, port));
  const std::string host = fmt::format("Host: localhost:{}\r\n", port);

  EXPECT_EQ(StatusOf(Exchange(port, HttpRequest("POST", "/v1/jobs", Request().dump(), host))), 401);
  EXPECT_EQ(StatusOf(Exchange(port, HttpRequest("POST", "/v1/jobs", Request().dump(),
                                                host + "Authorization: Bearer " + token + "\r\n"))),
            202);
}

// Cancels itself as soon as it hears of progress.
class CancelledContext : public JobContext {
 public:
  RigDevices& Devices() override { throw std::logic_error("a solve needs no devices"); }
  const Task& GetTask() const override { return task_; }
  void Report(std::string text) override {
    reports.push_back(std::move(text));
    cancel_ = true;
  }
  void Lit(std::vector<int> /*channels*/) override {}

  std::vector<std::string> reports;

 private:
  std::atomic<bool> cancel_ = false;
  Task task_{.cancel = &cancel_};
};

TEST_F(SolveJobTest, StopsSoonAfterItIsCancelledAndLeavesNothing) {
  const JobRequest job =
      SolveJob({.options = {.capture = Path("session"), .output = Path("maps")}}, "alice");
  EXPECT_FALSE(job.needs_rig);
  CancelledContext context;

  const Result<std::string> result = job.work(context);

  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
  EXPECT_GE(context.reports.size(), 1U);
  EXPECT_FALSE(std::filesystem::exists(Path("maps/normal.exr")));
}

}  // namespace
}  // namespace sateen::solve_job_test
