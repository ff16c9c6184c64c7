#include "scanner/daemon/answer_json.h"

#include <algorithm>
#include <array>
#include <ctime>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/json.h"

namespace sateen {
namespace {

using nlohmann::ordered_json;
using std::chrono::milliseconds;
using std::chrono::system_clock;

constexpr std::string_view kAnswer = "answer of the daemon";
constexpr std::array<std::pair<ErrorCode, std::string_view>, 8> kCodes = {
    {{ErrorCode::kInvalidArgument, "invalid-argument"},
     {ErrorCode::kBadData, "bad-data"},
     {ErrorCode::kDegenerate, "degenerate"},
     {ErrorCode::kIo, "io"},
     {ErrorCode::kDevice, "device"},
     {ErrorCode::kTimeout, "timeout"},
     {ErrorCode::kCancelled, "cancelled"},
     {ErrorCode::kOutOfMemory, "out-of-memory"}}};

// Writes JSON as one line. Messages echo requests and paths, which need not be UTF-8.
std::string OneLine(const ordered_json& json) { return JsonText(json); }

// Returns "2026-11-26T06:31:07Z".
std::string TimeText(system_clock::time_point time) {
  const std::time_t seconds = system_clock::to_time_t(time);
  std::tm utc = {};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> text = {};
  const std::size_t size = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return {text.data(), size};
}

// Parses the daemon's JSON. Text that is not JSON is kept as a string.
ordered_json Embedded(const std::string& text) {
  ordered_json json = ordered_json::parse(text, nullptr, /*allow_exceptions=*/false);
  return json.is_discarded() ? ordered_json(text) : json;
}

ordered_json ToJson(const Error& error) {
  return {{"code", Name(error.code)}, {"message", error.message}};
}

ordered_json ToJson(const JobRecord& job) {
  constexpr std::array kStates = {"running", "done", "failed"};
  ordered_json json = {{"id", job.id},
                       {"kind", job.kind},
                       {"what", job.what},
                       {"owner", job.owner},
                       {"since", TimeText(job.since)},
                       {"state", kStates.at(static_cast<std::size_t>(job.state))},
                       {"last_event", job.last_event}};
  if (job.ended) {
    json["ended"] = TimeText(*job.ended);
  }
  if (job.state == JobState::kDone) {
    json["result"] = Embedded(job.result);
  }
  if (job.error) {
    json["error"] = ToJson(*job.error);
  }
  return json;
}

template <typename T>
Result<T> Answered(JsonReader& json, T value) {
  const Status status = json.Finish();
  return status ? Result<T>(std::move(value)) : tl::unexpected(status.error());
}

Result<nlohmann::json> ParseAnswer(const std::string& text) {
  Result<nlohmann::json> json = ParseJson(text, std::string(kAnswer));
  if (json && !json->is_object()) {
    return Fail(ErrorCode::kBadData, "{} is no JSON object: '{}'", kAnswer, text.substr(0, 200));
  }
  return json;
}

}  // namespace

std::string_view Name(ErrorCode code) {
  const auto* const known = std::ranges::find(kCodes, code, &decltype(kCodes)::value_type::first);
  return known->second;
}

std::string BusyText(const JobRecord& holder) {
  const std::string job =
      fmt::format("{}{}{} by {} since {} (job {})", holder.kind, holder.what.empty() ? "" : " of ",
                  holder.what, holder.owner, TimeText(holder.since), holder.id);
  return holder.has_rig
             ? fmt::format(
                   "the rig is in use: {}; wait for its end, or end it: Ctrl-C where it was "
                   "started, or sateen light off",
                   job)
             : fmt::format(
                   "a {} is running: {}; wait for its end, or cancel it: DELETE /v1/jobs/{}",
                   holder.kind, job, holder.id);
}

std::string StateJson(const RigState& state, const std::string& version) {
  ordered_json json = {{"schema", "sateen.state/1"}, {"version", version}};
  json["board"] = nullptr;
  if (state.board) {
    json["board"] = {{"port", state.board->port},
                     {"firmware", state.board->firmware},
                     {"protocol", state.board->protocol},
                     {"lights", state.board->lights}};
  }
  json["camera"] = nullptr;
  if (state.camera) {
    json["camera"] = {{"model", state.camera->model},
                      {"port", state.camera->port},
                      {"profile", state.camera->profile}};
  }
  json["job"] = state.job ? ToJson(*state.job) : ordered_json();
  json["last_job"] = state.last_job ? ToJson(*state.last_job) : ordered_json();
  json["lights"] = {{"lit", state.lit}};
  json["lights"]["fault"] =
      state.lights_fault.empty() ? ordered_json() : ordered_json(state.lights_fault);
  return OneLine(json);
}

std::string JobJson(const JobRecord& job) { return OneLine(ToJson(job)); }

std::string JobsJson(const std::vector<JobRecord>& jobs) {
  ordered_json json = {{"jobs", ordered_json::array()}};
  for (const JobRecord& job : jobs) {
    json["jobs"].push_back(ToJson(job));
  }
  return OneLine(json);
}

std::string BegunJson(std::uint64_t id) {
  return OneLine({{"id", id}, {"events", fmt::format("/v1/jobs/{}/events", id)}});
}

Result<std::uint64_t> BegunFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  json.Ignore("events");
  const int id = json.Integer("id");
  json.Require(id >= 1, "id", "is no number of a job");
  return Answered(json, static_cast<std::uint64_t>(std::max(id, 0)));
}

std::string ErrorJson(const Error& error, const std::optional<JobRecord>& holder) {
  ordered_json json = {{"error", ToJson(error)}};
  if (holder) {
    json["error"]["job"] = ToJson(*holder);
  }
  return OneLine(json);
}

Error ErrorFromJson(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  const nlohmann::json error =
      json.is_object() ? json.value("error", nlohmann::json()) : nlohmann::json();
  if (error.is_object() && error.contains("code") && error["code"].is_string() &&
      error.contains("message") && error["message"].is_string()) {
    for (const auto& [code, name] : kCodes) {
      if (error["code"] == name) {
        return {code, error["message"].get<std::string>()};
      }
    }
  }
  return {ErrorCode::kBadData,
          fmt::format("{}: an error was expected, but it says '{}'", kAnswer, text.substr(0, 200))};
}

std::string NoteJson(const std::string& text) { return OneLine({{"text", text}}); }

Result<std::string> NoteFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  std::string note = json.String("text");
  return Answered(json, std::move(note));
}

std::string EventJson(const CaptureEvent& event) {
  ordered_json json = {{"stage", event.stage},           {"done", event.done},
                       {"frames", event.frames},         {"light", event.light},
                       {"exposure_s", event.exposure_s}, {"peak", event.peak}};
  if (event.left_s) {
    json["left_s"] = *event.left_s;
  }
  return OneLine(json);
}

Result<CaptureEvent> CaptureEventFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  CaptureEvent event = {.stage = json.String("stage"),
                        .done = static_cast<std::size_t>(json.Integer("done")),
                        .frames = static_cast<std::size_t>(json.Integer("frames")),
                        .light = json.String("light"),
                        .exposure_s = json.Number("exposure_s"),
                        .peak = json.Number("peak"),
                        .left_s = json.OptionalNumber("left_s")};
  return Answered(json, std::move(event));
}

std::string SummaryJson(const CaptureSummary& summary) {
  const CaptureCheck& check = summary.check;
  ordered_json json = {{"taken", summary.taken},
                       {"kept", summary.kept},
                       {"rejected", summary.rejected},
                       {"notes", check.notes},
                       {"levels", check.levels},
                       {"ambient", check.ambient},
                       {"drift", check.drift},
                       {"seconds", summary.seconds},
                       {"camera_seconds", summary.camera_seconds}};
  for (const Shift& shift : check.shifts) {
    json["shifts_px"].push_back(shift.px.x());
    json["shifts_px"].push_back(shift.px.y());
  }
  return OneLine(json);
}

Result<CaptureSummary> SummaryFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  CaptureSummary summary;
  summary.taken = json.Integer("taken");
  summary.kept = json.Integer("kept");
  summary.rejected = json.Integer("rejected");
  summary.check.ambient = json.Number("ambient");
  summary.check.drift = json.Number("drift");
  summary.seconds = json.Number("seconds");
  summary.camera_seconds = json.Number("camera_seconds");
  const nlohmann::json& notes = parsed->value("notes", nlohmann::json::array());
  json.Ignore("notes");
  for (const nlohmann::json& note : notes) {
    summary.check.notes.push_back(note.is_string() ? note.get<std::string>() : note.dump());
  }
  const nlohmann::json& levels = parsed->value("levels", nlohmann::json::array());
  summary.check.levels = levels.empty()
                             ? std::vector<double>()
                             : json.OptionalNumberList("levels").value_or(std::vector<double>());
  json.Ignore("levels");
  const std::vector<double> shifts =
      json.OptionalNumberList("shifts_px").value_or(std::vector<double>());
  for (std::size_t k = 0; k + 1 < shifts.size(); k += 2) {
    summary.check.shifts.push_back({.px = {shifts[k], shifts[k + 1]}});
  }
  return Answered(json, std::move(summary));
}

std::string ForecastToJson(const CaptureForecast& forecast) {
  return OneLine({{"frames", forecast.plan.size()},
                  {"exposure_known", forecast.exposure_known},
                  {"port", forecast.port},
                  {"firmware", forecast.firmware},
                  {"camera", forecast.camera.model},
                  {"camera_port", forecast.camera.port},
                  {"profile", forecast.camera.profile},
                  {"exposure_s", forecast.settings.exposure_s},
                  {"f_number", forecast.settings.f_number},
                  {"iso", forecast.settings.iso},
                  {"bytes", forecast.bytes},
                  {"free_bytes", forecast.free_bytes}});
}

Result<CaptureForecast> ForecastFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  json.Ignore("frames");
  CaptureForecast forecast{
      .exposure_known = json.Boolean("exposure_known"),
      .port = json.String("port"),
      .firmware = json.String("firmware"),
      .camera = {json.String("camera"), json.String("camera_port"), json.String("profile")},
      .settings = {json.Number("exposure_s"), json.Number("f_number"), json.Number("iso")},
      .bytes = static_cast<std::uintmax_t>(json.Number("bytes")),
      .free_bytes = static_cast<std::uintmax_t>(json.Number("free_bytes"))};
  return Answered(json, std::move(forecast));
}

std::string PreviewJson(const Preview& preview, const std::filesystem::path& output) {
  return OneLine({{"output", output.string()},
                  {"width", preview.size_px.width},
                  {"height", preview.size_px.height},
                  {"exposure_s", preview.settings.exposure_s},
                  {"f_number", preview.settings.f_number},
                  {"iso", preview.settings.iso},
                  {"peak", preview.levels.peak}});
}

Result<Preview> PreviewAnswerFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  json.Ignore("output");
  Preview preview = {.size_px = {json.Integer("width"), json.Integer("height")},
                     .settings = {.exposure_s = json.Number("exposure_s"),
                                  .f_number = json.Number("f_number"),
                                  .iso = json.Number("iso")},
                     .levels = {.peak = json.Number("peak")}};
  return Answered(json, std::move(preview));
}

std::string LightOnJson(const LightOn& on) {
  return OneLine({{"level", on.level}, {"on_ms", on.on_time.count()}});
}

Result<LightOn> LightOnFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseAnswer(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kAnswer));
  const LightOn on = {.level = json.Number("level"),
                      .on_time = milliseconds(json.Integer("on_ms"))};
  return Answered(json, on);
}

}  // namespace sateen
