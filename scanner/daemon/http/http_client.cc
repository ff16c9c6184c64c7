#include "scanner/daemon/http/http_client.h"

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>
#include <utility>
#include <vector>

#include "core/notice.h"
#include "scanner/daemon/answer_json.h"
#include "scanner/daemon/api_json.h"
#include "scanner/daemon/http/event_parser.h"
#include "scanner/daemon/http/http_message.h"
#include "scanner/daemon/http/listener.h"
#include "scanner/daemon/http/unix_exchange.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// Longest wait for an answer: a camera that is opened takes its time.
constexpr seconds kPatience{120};
// For the first word of a daemon that is there.
constexpr seconds kGreeting{5};
// Silence allowed in a stream of events. The daemon sends a sign of life every 5 s.
constexpr seconds kSilence{30};
// How soon Ctrl-C is heard.
constexpr milliseconds kStep{20};
// How often a stream that breaks off is taken up again without having brought anything new.
constexpr int kResumes = 5;
// How long a daemon that has too many clients is left alone.
constexpr milliseconds kLater{200};
constexpr int kUnavailable = 503;

// Distinguishes a slow daemon from one that has died, which accepts no more connections.
Error NoAnswer(const std::filesystem::path& socket, const ExchangeFault& fault) {
  const bool slow = fault.while_reading && Accepts(socket);
  return {slow ? ErrorCode::kTimeout : ErrorCode::kDevice,
          fmt::format("the daemon at {} {}: {}; start it again, or end it to work without one",
                      socket.string(), slow ? "does not answer" : "is gone", fault.why)};
}

struct Answer {
  int status = 0;
  std::string body;
};

Result<Answer> AskWithin(const std::filesystem::path& socket, seconds patience,
                         const std::string& method, const std::string& path,
                         const std::string& body) {
  std::vector<HttpField> fields = {{"Host", "localhost"}};
  if (method != "GET") {
    fields.emplace_back("Content-Type", "application/json");
  }
  Answer answer;
  const auto status =
      ExchangeOnUnixSocket(socket, RequestText(method, path, fields, body),
                           {.connecting = kGreeting, .silence = patience},
                           [&](int /*status*/, std::string_view piece) { answer.body += piece; });
  if (!status) {
    return tl::unexpected(NoAnswer(socket, status.error()));
  }
  answer.status = *status;
  return answer;
}

Result<std::string> BodyOf(Result<Answer> answer) {
  if (!answer) {
    return tl::unexpected(answer.error());
  }
  return answer->status < 300 ? Result<std::string>(std::move(answer->body))
                              : tl::unexpected(ErrorFromJson(answer->body));
}

// Follows a job to its end, in a thread of its own, so that a cancelled task is heard meanwhile.
class Follower {
 public:
  Follower(std::filesystem::path socket, std::uint64_t job,
           const std::function<void(const JobEvent&)>& observer)
      : socket_(std::move(socket)), job_(job), observer_(observer), thread_([this] { Follow(); }) {}
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;
  ~Follower() { thread_.join(); }

  [[nodiscard]] bool Ended() const { return ended_; }
  // Both once it has ended. A job whose end was not heard may go on.
  [[nodiscard]] bool HeardTheEnd() const { return complete_; }
  [[nodiscard]] const Result<std::string>& Outcome() const { return outcome_; }

 private:
  void Take(const JobEvent& event) {
    last_event_ = event.sequence;
    if (event.type == "done") {
      outcome_ = event.data;
      complete_ = true;
    } else if (event.type == "failed") {
      outcome_ = tl::unexpected(ErrorFromJson(event.data));
      complete_ = true;
    } else if (event.type == "note") {
      Notice(NoteFromJson(event.data).value_or(event.data));
    } else if (observer_) {
      observer_(event);
    }
  }

  void Follow() {
    for (int resumes = 0; !complete_ && resumes < kResumes; ++resumes) {
      const std::uint64_t before = last_event_;
      if (!FollowOnce()) {
        break;
      }
      resumes = last_event_ > before ? 0 : resumes;
    }
    ended_ = true;
  }

  // Returns false where the daemon refuses for good, or nobody is there any more.
  bool FollowOnce() {
    const std::vector<HttpField> fields = {{"Host", "localhost"},
                                           {"Last-Event-ID", std::to_string(last_event_)}};
    EventParser parser([this](const JobEvent& event) { Take(event); });
    bool followed = false;
    std::string refusal;
    const auto status = ExchangeOnUnixSocket(
        socket_, RequestText("GET", fmt::format("/v1/jobs/{}/events", job_), fields, ""),
        {.connecting = kGreeting, .silence = kSilence}, [&](int code, std::string_view piece) {
          followed = code == 200;
          if (followed) {
            parser.Add(piece);
          } else {
            refusal += piece;
          }
        });
    if (complete_) {
      return true;
    }
    if (status && *status != 200) {
      outcome_ = tl::unexpected(ErrorFromJson(refusal));
      std::this_thread::sleep_for(*status == kUnavailable ? kLater : milliseconds(0));
      return *status == kUnavailable;
    }
    outcome_ = tl::unexpected(
        NoAnswer(socket_, status ? ExchangeFault{.why = "its events ended before the job"}
                                 : status.error()));
    return followed;  // broken off: to be taken up again
  }

  const std::filesystem::path socket_;
  const std::uint64_t job_;
  const std::function<void(const JobEvent&)>& observer_;
  std::uint64_t last_event_ = 0;
  bool complete_ = false;
  Result<std::string> outcome_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;  // last, as it uses the others
};

std::filesystem::path Absolute(const std::filesystem::path& path) {
  return path.empty() ? path : std::filesystem::absolute(path).lexically_normal();
}

}  // namespace

DaemonClient::DaemonClient(std::filesystem::path socket) : socket_(std::move(socket)) {}

Result<std::string> DaemonClient::Ask(const std::string& method, const std::string& path,
                                      const std::string& body) const {
  return BodyOf(AskWithin(socket_, kPatience, method, path, body));
}

Result<std::string> DaemonClient::RunJob(const std::string& path, const std::string& body,
                                         const std::function<void(const JobEvent&)>& observer,
                                         const Task& task) const {
  Result<std::string> posted = Ask("POST", path, body);
  if (!posted) {
    return posted;
  }
  const Result<std::uint64_t> id = BegunFromJson(*posted);
  if (!id) {
    return tl::unexpected(id.error());
  }
  const Follower follower(socket_, *id, observer);
  for (bool cancelled = false; !follower.Ended(); std::this_thread::sleep_for(kStep)) {
    if (task.Cancelled() && !cancelled) {
      cancelled = true;
      // The end of the job tells how it went; without an end there is no daemon to be told.
      [[maybe_unused]] const auto ignored = Ask("DELETE", fmt::format("/v1/jobs/{}", *id));
    }
  }
  if (!follower.HeardTheEnd()) {
    // Nobody is left to watch it.
    [[maybe_unused]] const auto ignored = Ask("DELETE", fmt::format("/v1/jobs/{}", *id));
  }
  return follower.Outcome();
}

Result<std::optional<DaemonClient>> FindDaemon() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing in this program sets variables
  const char* const named = std::getenv("SATEEN_SOCKET");
  const std::vector<std::filesystem::path> places =
      named != nullptr
          ? std::vector<std::filesystem::path>{named}
          : std::vector<std::filesystem::path>{DefaultSocketPath(), "/run/sateen/sateen.sock"};
  for (const std::filesystem::path& place : places) {
    if (place.empty() || !Accepts(place)) {
      continue;
    }
    Result<Answer> state = AskWithin(place, kGreeting, "GET", "/v1/state", "");
    // One that has too many clients is a daemon, and turns the lights off all the same.
    const bool is_full = state && state->status == kUnavailable;
    if (const Result<std::string> body = BodyOf(std::move(state)); !body && !is_full) {
      return tl::unexpected(body.error());
    }
    return std::optional<DaemonClient>(DaemonClient(place));
  }
  return std::optional<DaemonClient>();
}

Result<CaptureSummary> CaptureByDaemon(const DaemonClient& daemon, const CaptureRequest& request,
                                       const Task& task, const CaptureObserver& observer) {
  CaptureRequest absolute = request;
  absolute.rig = Absolute(request.rig);
  absolute.output = Absolute(request.output);
  const auto observe = [&](const JobEvent& event) {
    if (const Result<CaptureEvent> capture = CaptureEventFromJson(event.data);
        capture && observer) {
      observer(*capture);
    }
  };
  const Result<std::string> result =
      daemon.RunJob("/v1/jobs", CaptureToJson(absolute, ""), observe, task);
  if (!result) {
    return tl::unexpected(result.error());
  }
  Result<CaptureSummary> summary = SummaryFromJson(*result);
  const Result<Session> session = ReadSessionRecord(absolute.output);
  if (summary && !session) {
    return tl::unexpected(session.error());
  }
  if (summary) {
    summary->session = *session;
  }
  return summary;
}

Result<CaptureForecast> ForecastByDaemon(const DaemonClient& daemon,
                                         const CaptureRequest& request) {
  CaptureRequest absolute = request;
  absolute.rig = Absolute(request.rig);
  absolute.output = Absolute(request.output);
  Result<CaptureForecast> forecast =
      daemon.Ask("POST", "/v1/jobs", CaptureToJson(absolute, "", /*dry_run=*/true))
          .and_then(ForecastFromJson);
  const Result<Rig> rig = forecast ? ReadRig(request.rig) : tl::unexpected(forecast.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  forecast->request = request;
  forecast->plan = PlanOf(*rig, {request.options.exposure_s.value_or(1.0)});
  return forecast;
}

Result<Preview> PreviewByDaemon(const DaemonClient& daemon, const PreviewRequest& request,
                                const std::filesystem::path& output, const Task& task) {
  PreviewRequest absolute = request;
  absolute.rig = Absolute(request.rig);
  return daemon.RunJob("/v1/jobs", PreviewToJson(absolute, Absolute(output), ""), {}, task)
      .and_then(PreviewAnswerFromJson);
}

Result<bool> KeepLightOnByDaemon(const DaemonClient& daemon, const LightRequest& request,
                                 const Task& task,
                                 const std::function<void(const LightOn&)>& began) {
  const auto observe = [&](const JobEvent& event) {
    if (const Result<LightOn> on = LightOnFromJson(event.data)) {
      began(*on);
    }
  };
  const Result<std::string> result = daemon.RunJob(fmt::format("/v1/lights/{}", request.channel),
                                                   LightToJson(request, ""), observe, task);
  if (result) {
    return false;
  }
  // Cancelled by this program's own Ctrl-C, it has ended as it was asked to.
  return result.error().code == ErrorCode::kCancelled && task.Cancelled()
             ? Result<bool>(true)
             : tl::unexpected(result.error());
}

Result<BoardWord> ChangeBoardByDaemon(const DaemonClient& daemon, const BoardChange& change) {
  const Result<std::string> word = daemon.Ask("POST", "/v1/board", BoardChangeToJson(change, ""));
  return word ? BoardFromJson(*word) : tl::unexpected(word.error());
}

Status LightsOffByDaemon(const DaemonClient& daemon) {
  return daemon.Ask("POST", "/v1/lights/off").and_then(NoneLitFromJson);
}

Result<std::vector<DeviceReply>> DevicesByDaemon(const DaemonClient& daemon) {
  const Result<std::string> devices = daemon.Ask("GET", "/v1/devices");
  return devices ? DevicesFromJson(*devices) : tl::unexpected(devices.error());
}

}  // namespace sateen
