#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "scanner/daemon/api.h"
#include "scanner/daemon/http/access.h"
#include "scanner/daemon/http/http_server.h"
#include "scanner/daemon/rig_service.h"
#include "tests/scanner/daemon/http_talk.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"

// The daemon with the real firmware in simulated time, under clients right and wrong; the board's
// pins are the witness.
namespace sateen::testing {

// A light that is on while no job runs, or with another one: seen at every change of a pin, not
// only after calls.
class PinWitness {
 public:
  PinWitness(VirtualBoard& board, const RigService& service) : service_(service) {
    board.Watch({.light = [this](const LightChange& change) { Changed(change); }});
  }
  [[nodiscard]] unsigned Lit() const { return lit_; }
  [[nodiscard]] int TimesOn() const { return times_on_; }
  [[nodiscard]] int Two() const { return two_; }
  [[nodiscard]] int WithoutJob() const { return without_job_; }

 private:
  void Changed(const LightChange& change) {
    const unsigned bit = 1U << change.light;
    const unsigned before = lit_;
    const unsigned lit = change.level > 0.0 ? before | bit : before & ~bit;
    lit_ = lit;
    if (change.level > 0.0) {
      times_on_ += (before & bit) == 0 ? 1 : 0;
      two_ += std::popcount(lit) > 1 ? 1 : 0;
      without_job_ += service_.State().job ? 0 : 1;
    }
  }

  const RigService& service_;
  std::atomic<unsigned> lit_ = 0;
  std::atomic<int> times_on_ = 0;
  std::atomic<int> two_ = 0;
  std::atomic<int> without_job_ = 0;
};

// Has the folder for temporary files to itself as long as this lives: what is found in it has been
// left there. It changes the environment, so it comes before other threads and goes after them.
class PrivateTempDir {
 public:
  PrivateTempDir() { setenv("TMPDIR", folder_.Path().c_str(), 1); }
  PrivateTempDir(const PrivateTempDir&) = delete;
  PrivateTempDir& operator=(const PrivateTempDir&) = delete;
  ~PrivateTempDir() {
    if (former_) {
      setenv("TMPDIR", former_->c_str(), 1);
    } else {
      unsetenv("TMPDIR");
    }
  }
  [[nodiscard]] const std::filesystem::path& Path() const { return folder_.Path(); }

 private:
  static std::optional<std::string> Former() {
    const char* former = std::getenv("TMPDIR");
    return former == nullptr ? std::nullopt : std::optional<std::string>(former);
  }

  std::optional<std::string> former_ = Former();
  TempFolder folder_;
};

// Lives as long as the daemon; the board and the witness are used by the job's thread.
struct StressedDaemon {
  explicit StressedDaemon(const HttpServerOptions& options) {
    WriteText(rig_file, RigToJson(rig));
    auto local = Listener::OnUnixSocket(socket);
    auto loopback = Listener::OnLoopback("127.0.0.1:0");
    port = loopback->Port();
    servers.push_back(
        std::make_unique<HttpServer>(*std::move(local), api, service, std::nullopt, options));
    servers.push_back(std::make_unique<HttpServer>(*std::move(loopback), api, service,
                                                   AccessRules(token, port), options));
  }

  StressedDaemon(const StressedDaemon&) = delete;
  StressedDaemon& operator=(const StressedDaemon&) = delete;
  ~StressedDaemon() { service.Stop(); }  // while the witness still looks

  TempFolder folder;
  PrivateTempDir scratch;
  std::filesystem::path socket = folder.Path() / "s.sock";
  std::filesystem::path rig_file = folder.Path() / "rig.json";
  std::string token = "0123456789abcdef0123456789abcdef";
  int port = 0;
  Rig rig = CaptureRig();
  std::unique_ptr<VirtualBoard> board = *VirtualBoard::Load(Firmware());
  RigService service{
      std::make_unique<RigDevices>(std::make_unique<SimulatedPort>(*board),
                                   std::make_unique<LitCamera>(*board, LightImages(rig)))};
  PinWitness witness{*board, service};
  Api api{service, {.version = "stress", .capture = QuickCapture()}};
  std::vector<std::unique_ptr<HttpServer>> servers;
};

struct StressCounts {
  std::map<std::string, std::map<int, int>> statuses;  // statuses per kind of call
  std::vector<double> milliseconds;                    // time per call
  std::vector<std::string> wrong;                      // violations; must be empty
};

// One client: calls of random kinds, each checked.
class StressClient {
 public:
  StressClient(StressedDaemon& daemon, std::uint64_t seed) : daemon_(daemon), random_(seed) {}

  // A capture, or anything else.
  void Call(bool capture) {
    const auto start = std::chrono::steady_clock::now();
    const int kind = capture ? 19 : Any(19);
    if (kind < 9) {
      CallRight(kind);
    } else if (kind < 14) {
      CallWrong(kind);
    } else if (kind < 19) {
      CallOverTcp(kind);
    } else {
      Expect("capture", Ask("POST", "/v1/jobs", CaptureBody()), {202, 409});
    }
    counts.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    CheckRig();
  }

  StressCounts counts;

 private:
  int Any(int below) { return static_cast<int>(random_() % static_cast<std::uint64_t>(below)); }

  std::string Ask(const std::string& method, const std::string& path,
                  const std::string& body = "") {
    return Exchange(daemon_.socket, HttpRequest(method, path, body));
  }

  // 503 for either of two reasons is a right answer to anything.
  void Expect(const std::string& what, const std::string& answer, std::vector<int> statuses) {
    const int status = StatusOf(answer);
    ++counts.statuses[what][status];
    const bool may_be_refused = answer.find("too many clients") != std::string::npos ||
                                answer.find("being turned off") != std::string::npos;
    statuses.push_back(may_be_refused ? 503 : -1);
    const bool fits = std::ranges::find(statuses, status) != statuses.end();
    const bool is_json = status == 0 || answer.find("event-stream") != std::string::npos ||
                         nlohmann::json::accept(BodyOf(answer));
    if (!fits || !is_json) {
      counts.wrong.push_back(what + ": " + answer.substr(0, 400));
    }
  }

  // One of the latest, or one that is not known.
  std::string SomeJob() {
    const std::vector<JobRecord> jobs = daemon_.service.Jobs();
    const std::uint64_t last = jobs.empty() ? 1 : jobs.back().id;
    return fmt::format("/v1/jobs/{}", last + 5 - std::min<std::uint64_t>(random_() % 30, last));
  }

  void CallRight(int kind) {
    switch (kind) {
      case 0:
        return Expect("GET state", Ask("GET", "/v1/state"), {200});
      case 1:
        return Expect("GET jobs", Ask("GET", "/v1/jobs"), {200});
      case 2:
        return Expect("GET job", Ask("GET", SomeJob()), {200, 404});
      case 3:
        return Expect("DELETE job", Ask("DELETE", Any(4) == 0 ? CurrentJob() : SomeJob()),
                      {200, 202, 404});
      case 4:
        return Expect("GET board", Ask("GET", "/v1/board"), {200, 409, 503});
      case 5:
        return Any(8) == 0 ? Expect("lights off", Ask("POST", "/v1/lights/off"), {200, 202, 503})
                           : Expect("wrong method", Ask("GET", "/v1/lights/off"), {405});
      case 6:
        return FollowForAWhile();
      default:
        return TurnOnALight();
    }
  }

  // One of the board's 14, or one that it has not.
  void TurnOnALight() {
    const int light = Any(16);
    Expect(light < 14 ? "light" : "light that is not there",
           Ask("POST", fmt::format("/v1/lights/{}", light),
               fmt::format(R"({{"level": {}, "for_ms": {}, "client": "c{}"}})", Any(11) / 10.0,
                           1 + Any(900), Any(3))),
           {light < 14 ? 202 : 400, 409});
  }

  std::string CurrentJob() {
    const std::optional<JobRecord> job = daemon_.service.State().job;
    return job ? fmt::format("/v1/jobs/{}", job->id) : SomeJob();
  }

  // Goes away when something has come, whatever it is.
  void FollowForAWhile() {
    RawClient follower(daemon_.socket);
    follower.Send(HttpRequest("GET", CurrentJob() + "/events"));
    Expect("events", follower.Read("\n\n"), {200, 404});
  }

  std::string Garbage(std::size_t size) {
    std::string bytes(size, '\0');
    for (char& byte : bytes) {
      byte = static_cast<char>(random_());
    }
    return bytes;
  }

  void CallWrong(int kind) {
    switch (kind) {
      case 9: {
        std::string body = CaptureBody();
        body[static_cast<std::size_t>(Any(static_cast<int>(body.size())))] = '\x01';
        return Expect("malformed JSON", Ask("POST", "/v1/jobs", body), {400});
      }
      case 10:
        return Expect("oversized body",
                      Ask("POST", "/v1/jobs",
                          std::string(65'537 + static_cast<std::size_t>(Any(200'000)), ' ')),
                      {413});
      case 11:
        return Expect("no HTTP", Exchange(daemon_.socket, Garbage(300) + "\r\n\r\n"), {0, 400});
      case 12:
        return Expect("unknown", Ask(Any(2) == 0 ? "PUT" : "GET", fmt::format("/v{}/x", Any(9))),
                      {404});
      default:
        return BeSlow();
    }
  }

  // Leaves in the middle of a request, or stays without a word until others have come.
  void BeSlow() {
    const std::string request = HttpRequest("POST", "/v1/lights/3", R"({"level": 1})");
    auto client = std::make_unique<RawClient>(daemon_.socket);
    client->Send(
        request.substr(0, static_cast<std::size_t>(Any(static_cast<int>(request.size())))));
    slow_.push_back(std::move(client));
    if (slow_.size() > 8) {
      slow_.erase(slow_.begin());
    }
    ++counts.statuses["slow client"][0];
  }

  void CallOverTcp(int kind) {
    const std::string host = fmt::format("Host: localhost:{}\r\n", daemon_.port);
    const std::string token = fmt::format("Authorization: Bearer {}\r\n", daemon_.token);
    const auto ask = [&](const std::string& headers) {
      return Exchange(daemon_.port,
                      HttpRequest("POST", fmt::format("/v1/lights/{}", Any(14)),
                                  R"({"level": 0.5, "for_ms": 50, "client": "tcp"})", headers));
    };
    switch (kind) {
      case 14:
        return Expect("TCP with token", ask(host + token), {202, 409});
      case 15:
        return Expect("TCP, wrong token",
                      ask(host + fmt::format("Authorization: Bearer {:x<32}\r\n", Any(1 << 30))),
                      {401});
      case 16:
        return Expect("TCP, no token", ask(host), {401});
      case 17:
        return Expect("TCP, foreign host", ask("Host: evil.example\r\n" + token), {421});
      default:
        return Expect("TCP, web page", ask(host + token + "Origin: http://evil.example\r\n"),
                      {403});
    }
  }

  std::string CaptureBody() {
    return fmt::format(R"({{"kind": "capture", "rig": "{}", "output": "{}/session-{}"}})",
                       daemon_.rig_file.string(), daemon_.folder.Path().string(), random_());
  }

  // Where the state says before and after that no job runs, and none ran between, the pins are
  // dark.
  void CheckRig() {
    const auto idle_after = [&]() -> std::optional<std::uint64_t> {
      const nlohmann::json state = nlohmann::json::parse(BodyOf(Ask("GET", "/v1/state")), nullptr,
                                                         /*allow_exceptions=*/false);
      if (state.is_discarded() || !state.contains("job") || !state["job"].is_null()) {
        return std::nullopt;
      }
      if (state["lights"]["lit"] != nlohmann::json::array()) {
        counts.wrong.push_back("idle, but lit: " + state.dump());
      }
      return state["last_job"].is_null() ? 0 : state["last_job"]["id"].get<std::uint64_t>();
    };
    const std::optional<std::uint64_t> before = idle_after();
    const unsigned lit = daemon_.witness.Lit();
    const std::optional<std::uint64_t> after = before ? idle_after() : std::nullopt;
    if (before && after == before && lit != 0) {
      counts.wrong.push_back(fmt::format("idle after job {}, but pins {:#x} are on", *before, lit));
    }
  }

  StressedDaemon& daemon_;
  std::mt19937_64 random_;
  std::vector<std::unique_ptr<RawClient>> slow_;
};

}  // namespace sateen::testing
