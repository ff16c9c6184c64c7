#include "scanner/daemon/api.h"

#include <algorithm>
#include <charconv>
#include <utility>
#include <vector>

#include "scanner/daemon/answer_json.h"
#include "scanner/daemon/api_json.h"
#include "scanner/daemon/rig_jobs.h"
#include "scanner/daemon/solve_json.h"

namespace sateen {
namespace {

// How often an urgent job asks for the rig, which keeps it for that job meanwhile.
constexpr std::chrono::milliseconds kAskAgain{500};

// A whole number without a sign; nothing for other text.
template <typename T>
std::optional<T> WholeNumber(const std::string& text) {
  T number = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && rest == text.data() + text.size() && number >= 0;
  return whole ? std::optional(number) : std::nullopt;
}

// Returns the owner of a job: the name that a client gives itself, and what the transport knows.
std::string OwnerName(const std::string& client, const std::string& who) {
  return client.empty() ? who : fmt::format("{} ({})", client, who);
}

// Returns what stands in the place of {} if `path` has the form of `pattern`, "/v1/jobs/{}".
std::optional<std::string> Match(std::string_view pattern, std::string_view path) {
  const std::size_t place = pattern.find("{}");
  if (place == std::string_view::npos) {
    return pattern == path ? std::optional<std::string>("") : std::nullopt;
  }
  const std::string_view before = pattern.substr(0, place);
  const std::string_view after = pattern.substr(place + 2);
  if (path.size() <= before.size() + after.size() || !path.starts_with(before) ||
      !path.ends_with(after)) {
    return std::nullopt;
  }
  const std::string_view value =
      path.substr(before.size(), path.size() - before.size() - after.size());
  return value.find('/') == std::string_view::npos ? std::optional<std::string>(value)
                                                   : std::nullopt;
}

ApiResponse RefusedBusy(const JobRefusal& refusal) {
  return {.status = refusal.holder ? 409 : 503, .body = ErrorJson(refusal.error, refusal.holder)};
}

ApiResponse Ended(const tl::expected<JobRecord, JobRefusal>& ended) {
  if (!ended) {
    return RefusedBusy(ended.error());
  }
  return ended->error ? Refused(HttpStatus(ended->error->code), *ended->error)
                      : ApiResponse{.body = ended->result};
}

ApiResponse NoSuchJob(const std::string& id) {
  return Refused(404, {ErrorCode::kInvalidArgument,
                       fmt::format("there is no job '{}'; the latest are at GET /v1/jobs", id)});
}

}  // namespace

struct Api::Route {
  std::string_view method;
  std::string_view pattern;
  ApiResponse (Api::*handler)(const ApiRequest&, Parameter) const;
};

const std::vector<Api::Route>& Api::Routes() {
  // The first that fits is taken.
  static const std::vector<Route> routes = {{"GET", "/v1/state", &Api::GetState},
                                            {"GET", "/v1/devices", &Api::GetDevices},
                                            {"GET", "/v1/board", &Api::GetBoard},
                                            {"POST", "/v1/board", &Api::PostBoard},
                                            {"GET", "/v1/jobs", &Api::GetJobs},
                                            {"POST", "/v1/jobs", &Api::PostJob},
                                            {"GET", "/v1/jobs/{}", &Api::GetJob},
                                            {"DELETE", "/v1/jobs/{}", &Api::DeleteJob},
                                            {"GET", "/v1/jobs/{}/events", &Api::GetEvents},
                                            {"POST", "/v1/preview", &Api::PostPreview},
                                            {"POST", "/v1/lights/off", &Api::PostLightsOff},
                                            {"POST", "/v1/lights/{}", &Api::PostLight}};
  return routes;
}

ApiResponse Refused(int status, const Error& error) {
  return {.status = status, .body = ErrorJson(error)};
}

int HttpStatus(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 400;
    case ErrorCode::kBadData:
    case ErrorCode::kDegenerate:
      return 422;
    case ErrorCode::kIo:
    case ErrorCode::kOutOfMemory:
      return 500;
    case ErrorCode::kTimeout:
      return 504;
    case ErrorCode::kDevice:
    case ErrorCode::kCancelled:
      return 503;
  }
  return 500;
}

ApiResponse RefusedUnbegun(const Error& error) {
  return Refused(error.code == ErrorCode::kIo ? 422 : HttpStatus(error.code), error);
}

bool IsLightsOff(const std::string& method, const std::string& path) {
  return method == "POST" && path == "/v1/lights/off";
}

Api::Api(RigService& service, ApiOptions options)
    : service_(service), options_(std::move(options)), files_(options_.files) {}

ApiResponse Api::Handle(const ApiRequest& request) const {
  std::string allow;
  for (const Route& route : Routes()) {
    const std::optional<std::string> parameter = Match(route.pattern, request.path);
    if (!parameter) {
      continue;
    }
    if (request.method == route.method) {
      return (this->*route.handler)(request, *parameter);
    }
    if (allow.find(route.method) == std::string::npos) {
      allow += fmt::format("{}{}", allow.empty() ? "" : ", ", route.method);
    }
  }
  if (allow.empty()) {
    return Refused(404, {ErrorCode::kInvalidArgument,
                         fmt::format("there is nothing at '{}'; docs/api.md lists what there is, "
                                     "as GET /v1/state",
                                     request.path)});
  }
  ApiResponse response = Refused(
      405, {ErrorCode::kInvalidArgument,
            fmt::format("{} is not for '{}'; need {}", request.method, request.path, allow)});
  response.allow = allow;
  return response;
}

ApiResponse Api::GetState(const ApiRequest& /*request*/, Parameter /*none*/) const {
  return {.body = StateJson(service_.State(), options_.version)};
}

ApiResponse Api::GetDevices(const ApiRequest& request, Parameter /*none*/) const {
  return RunToEnd(request, DevicesJob(request.who));
}

ApiResponse Api::GetBoard(const ApiRequest& request, Parameter /*none*/) const {
  return RunToEnd(request, BoardJob({}, request.who));
}

ApiResponse Api::PostBoard(const ApiRequest& request, Parameter /*none*/) const {
  const Result<PostedBoardChange> posted = BoardChangeFromJson(request.body);
  return posted
             ? RunToEnd(request, BoardJob(posted->change, OwnerName(posted->client, request.who)))
             : Refused(400, posted.error());
}

ApiResponse Api::GetJobs(const ApiRequest& /*request*/, Parameter /*none*/) const {
  return {.body = JobsJson(service_.Jobs())};
}

std::optional<ApiResponse> Api::CannotBegin(const ApiRequest& request,
                                            std::function<Status()> check) const {
  // A job that has the rig matters more, and Begin() answers with it.
  if (service_.State().job) {
    return std::nullopt;
  }
  const Status checked = files_.Run(std::move(check), request.client_left);
  return checked || service_.State().job ? std::nullopt
                                         : std::optional(RefusedUnbegun(checked.error()));
}

ApiResponse Api::PostJob(const ApiRequest& request, Parameter /*none*/) const {
  const std::string kind = KindOfJob(request.body);
  if (kind == "preview") {
    return PostPreviewJob(request);
  }
  if (kind == "solve") {
    return PostSolveJob(request);
  }
  const Result<PostedCapture> posted = CaptureFromJson(request.body, options_.capture);
  if (!posted) {
    return Refused(400, posted.error());
  }
  if (auto refused =
          CannotBegin(request, [asked = posted->request] { return CheckCapture(asked); })) {
    return *std::move(refused);
  }
  std::string owner = OwnerName(posted->client, request.who);
  return posted->dry_run ? RunToEnd(request, ForecastJob(posted->request, std::move(owner)))
                         : Begin(CaptureJob(posted->request, std::move(owner)));
}

ApiResponse Api::PostPreviewJob(const ApiRequest& request) const {
  const Result<PostedPreview> posted = PreviewFromJson(request.body);
  if (!posted) {
    return Refused(400, posted.error());
  }
  if (posted->output.empty()) {
    return Refused(400, {ErrorCode::kInvalidArgument,
                         "request: output: is missing; need the file of the picture, an absolute "
                         "path, or POST /v1/preview, which answers with the picture"});
  }
  if (auto refused =
          CannotBegin(request, [asked = posted->request] { return CheckPreview(asked); })) {
    return *std::move(refused);
  }
  return Begin(
      PreviewJob(posted->request, posted->output, nullptr, OwnerName(posted->client, request.who)));
}

ApiResponse Api::PostSolveJob(const ApiRequest& request) const {
  Result<PostedSolve> posted = SolveFromJson(request.body);
  if (!posted) {
    return Refused(400, posted.error());
  }
  std::string owner = OwnerName(posted->client, request.who);
  return Begin(SolveJob(std::move(posted->request), std::move(owner)));
}

ApiResponse Api::GetJob(const ApiRequest& /*request*/, Parameter id) const {
  const std::optional<JobRecord> job = service_.Find(WholeNumber<std::uint64_t>(id).value_or(0));
  return job ? ApiResponse{.body = JobJson(*job)} : NoSuchJob(id);
}

ApiResponse Api::DeleteJob(const ApiRequest& request, Parameter id) const {
  const std::uint64_t number = WholeNumber<std::uint64_t>(id).value_or(0);
  if (!service_.Cancel(number, request.who)) {
    return NoSuchJob(id);
  }
  const std::optional<JobRecord> job = service_.Find(number);
  return job ? ApiResponse{.status = job->state == JobState::kRunning ? 202 : 200,
                           .body = JobJson(*job)}
             : NoSuchJob(id);
}

ApiResponse Api::GetEvents(const ApiRequest& request, Parameter id) const {
  const std::optional<JobRecord> job = service_.Find(WholeNumber<std::uint64_t>(id).value_or(0));
  if (!job) {
    return NoSuchJob(id);
  }
  return {.events =
              ApiResponse::Events{.job = job->id, .after = request.last_event_id.value_or(0)}};
}

// Turns all lights off. For safety it is never refused for a job that runs: that job is cancelled,
// and so is one that gets in between. It goes on when its client has left.
ApiResponse Api::PostLightsOff(const ApiRequest& request, Parameter /*none*/) const {
  using std::chrono::milliseconds;
  const auto deadline = std::chrono::steady_clock::now() + options_.off_wait;
  std::optional<std::uint64_t> off;  // the job that turns them off, once it has begun
  while (true) {
    std::uint64_t id = off.value_or(0);
    if (!off) {
      const tl::expected<std::uint64_t, JobRefusal> begun =
          service_.Begin(LightsOffJob(request.who));
      if (!begun && !begun.error().holder) {
        return RefusedBusy(begun.error());
      }
      id = begun ? *begun : begun.error().holder->id;
      if (begun) {
        off = id;
      } else {
        service_.Cancel(id, request.who);
      }
    }
    const auto left =
        std::chrono::duration_cast<milliseconds>(deadline - std::chrono::steady_clock::now());
    const JobWait wait = service_.AwaitEnd(id, std::clamp(left, milliseconds(0), kAskAgain));
    const JobRecord job = service_.Find(id).value_or(JobRecord{.id = id, .state = JobState::kDone});
    if (wait.end == WaitEnd::kBoardLost) {
      return Refused(503, {ErrorCode::kDevice, wait.lights_fault});
    }
    if (wait.end == WaitEnd::kRunning && left <= kAskAgain) {
      return {.status = 202, .body = JobJson(job)};
    }
    if (wait.end == WaitEnd::kEnded && off) {
      return Ended(job);
    }
  }
}

ApiResponse Api::PostPreview(const ApiRequest& request, Parameter /*none*/) const {
  const Result<PostedPreview> posted = PreviewFromJson(request.body);
  if (!posted) {
    return Refused(400, posted.error());
  }
  if (auto refused =
          CannotBegin(request, [asked = posted->request] { return CheckPreview(asked); })) {
    return *std::move(refused);
  }
  const auto jpeg = std::make_shared<std::string>();
  const auto ended = service_.RunToEnd(
      PreviewJob(posted->request, posted->output, jpeg, OwnerName(posted->client, request.who)),
      request.client_left);
  ApiResponse response = Ended(ended);
  // Without its client the job is left running, and the picture is its own.
  if (ended && ended->state == JobState::kDone && !jpeg->empty()) {
    response.body = std::move(*jpeg);
    response.content_type = "image/jpeg";
  }
  return response;
}

ApiResponse Api::PostLight(const ApiRequest& request, Parameter channel) const {
  const std::optional<int> number = WholeNumber<int>(channel);
  if (!number) {
    return Refused(404,
                   {ErrorCode::kInvalidArgument,
                    fmt::format("'{}' is no number of a light; need 0, 1, ... or off", channel)});
  }
  const Result<PostedLight> posted = LightFromJson(request.body, *number);
  if (!posted) {
    return Refused(400, posted.error());
  }
  // A board that nobody has asked yet is asked first.
  if (!service_.State().board) {
    if (ApiResponse asked = RunToEnd(request, BoardJob({}, request.who)); asked.status != 200) {
      return asked;
    }
  }
  const std::optional<KnownBoard> board = service_.State().board;
  if (board && *number >= board->lights) {
    return Refused(
        400, {ErrorCode::kInvalidArgument,
              fmt::format("light {}: the board has lights 0 to {}", *number, board->lights - 1)});
  }
  return Begin(LightJob(posted->request, OwnerName(posted->client, request.who)));
}

ApiResponse Api::Begin(JobRequest job) const {
  const tl::expected<std::uint64_t, JobRefusal> id = service_.Begin(std::move(job));
  return id ? ApiResponse{.status = 202, .body = BegunJson(*id)} : RefusedBusy(id.error());
}

ApiResponse Api::RunToEnd(const ApiRequest& request, JobRequest job) const {
  return Ended(service_.RunToEnd(std::move(job), request.client_left));
}

}  // namespace sateen
