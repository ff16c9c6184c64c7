#include "scanner/daemon/api_json.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "core/json.h"
#include "scanner/daemon/request_json.h"

namespace sateen {
namespace {

using nlohmann::ordered_json;
using std::chrono::milliseconds;

constexpr std::pair<SessionKind, std::string_view> kKinds[] = {{SessionKind::kFabric, "fabric"},
                                                               {SessionKind::kSheet, "sheet"},
                                                               {SessionKind::kChart, "chart"},
                                                               {SessionKind::kBoard, "board"}};

std::optional<milliseconds> ReadTime(JsonReader& json, std::string_view key) {
  const std::optional<int> ms = json.OptionalInteger(key);
  json.Require(!ms || *ms >= 0, key, fmt::format("is {}; need milliseconds", ms.value_or(0)));
  return ms ? std::optional(milliseconds(*ms)) : std::nullopt;
}

SessionKind ReadSessionKindOr(JsonReader& json, SessionKind otherwise) {
  const std::optional<std::string> text = json.OptionalString("session_kind");
  if (!text) {
    return otherwise;
  }
  const auto* const kind =
      std::ranges::find_if(kKinds, [&](const auto& known) { return known.second == *text; });
  json.Require(kind != std::end(kKinds), "session_kind",
               fmt::format("is '{}'; need fabric, sheet, chart or board", *text));
  return kind == std::end(kKinds) ? otherwise : kind->first;
}

// The checks, in the order of their struct.
constexpr std::pair<std::string_view, double FrameCheckOptions::*> kChecks[] = {
    {"max_saturated", &FrameCheckOptions::max_saturated},
    {"min_level", &FrameCheckOptions::min_level},
    {"max_level_change", &FrameCheckOptions::max_level_change},
    {"max_rough_level_change", &FrameCheckOptions::max_rough_level_change},
    {"other_light_misfit", &FrameCheckOptions::other_light_misfit},
    {"max_ambient", &FrameCheckOptions::max_ambient},
    {"max_drift", &FrameCheckOptions::max_drift},
    {"max_shift_px", &FrameCheckOptions::max_shift_px},
    {"min_shift_peak", &FrameCheckOptions::min_shift_peak},
    {"min_shade", &FrameCheckOptions::min_shade},
    {"max_exposure_error", &FrameCheckOptions::max_exposure_error}};

void ReadCaptureOptions(JsonReader& json, CaptureOptions& options) {
  options.kind = ReadSessionKindOr(json, options.kind);
  if (const std::optional<double> exposure_s = json.OptionalNumber("exposure_s")) {
    options.exposure_s = *exposure_s;
  }
  Take(json.OptionalNumber("f_number"), options.f_number);
  Take(json.OptionalNumber("iso"), options.iso);
  Take(json.OptionalInteger("brackets"), options.brackets);
  Take(json.OptionalNumber("level"), options.level);
  Take(ReadTime(json, "settle_ms"), options.settle);
  Take(ReadTime(json, "margin_ms"), options.margin);
  Take(ReadTime(json, "deadline_ms"), options.deadline);
  Take(json.OptionalInteger("tries"), options.tries);
}

// Checks what a capture would refuse, before it has the rig.
Status CheckPosted(const CaptureRequest& request) {
  if (request.output.empty()) {
    return Fail(ErrorCode::kInvalidArgument,
                "request: output: is missing; need the folder of the "
                "session, an absolute path");
  }
  if (request.resume != request.rig.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "request: rig: {}",
                request.resume ? "is given with resume; a session has its own: leave it out"
                               : "is missing; need a rig file, an absolute path");
  }
  if (request.new_exposure && !request.resume) {
    return Fail(ErrorCode::kInvalidArgument,
                "request: new_exposure: is given without resume; a new session has one anyway");
  }
  const Status valid = request.options.Validate();
  return valid ? Status{} : Fail(ErrorCode::kInvalidArgument, "request: {}", valid.error().message);
}

std::string Dump(const ordered_json& json) { return JsonText(json); }

ordered_json FromClient(const std::string& client) {
  return client.empty() ? ordered_json::object() : ordered_json{{"client", client}};
}

}  // namespace

std::string KindOfJob(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  const bool says = json.is_object() && json.contains("kind") && json["kind"].is_string();
  return says ? json["kind"].get<std::string>() : "";
}

Result<PostedCapture> CaptureFromJson(const std::string& text, const CaptureOptions& defaults) {
  const Result<nlohmann::json> parsed = ParseBody(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kRequest));
  const std::string kind = json.String("kind");
  json.Require(kind == "capture", "kind",
               fmt::format("is '{}'; need capture, preview or solve", kind));
  PostedCapture posted = {.client = ReadClient(json), .request = {.options = defaults}};
  CaptureRequest& request = posted.request;
  request.rig = ReadPath(json, "rig");
  request.output = ReadPath(json, "output");
  request.resume = TakeFlag(json, "resume");
  request.new_exposure = TakeFlag(json, "new_exposure");
  posted.dry_run = TakeFlag(json, "dry_run");
  ReadCaptureOptions(json, request.options);
  std::optional<JsonReader> checks = json.OptionalObject("checks");
  for (const auto& [key, member] : kChecks) {
    if (checks) {
      Take(checks->OptionalNumber(key), request.options.checks.*member);
    }
  }
  Status status = FinishRequest(json);
  if (status && checks) {
    status = FinishRequest(*checks);
  }
  if (status) {
    status = CheckPosted(request);
  }
  return status ? Result<PostedCapture>(std::move(posted)) : tl::unexpected(status.error());
}

std::string CaptureToJson(const CaptureRequest& request, const std::string& client, bool dry_run) {
  const CaptureOptions& options = request.options;
  ordered_json json = FromClient(client);
  json["kind"] = "capture";
  if (!request.rig.empty()) {
    json["rig"] = request.rig.string();
  }
  json["output"] = request.output.string();
  json["resume"] = request.resume;
  json["new_exposure"] = request.new_exposure;
  json["dry_run"] = dry_run;
  json["session_kind"] = Name(options.kind);
  if (options.exposure_s) {
    json["exposure_s"] = *options.exposure_s;
  }
  json["f_number"] = options.f_number;
  json["iso"] = options.iso;
  json["brackets"] = options.brackets;
  json["level"] = options.level;
  json["settle_ms"] = options.settle.count();
  json["margin_ms"] = options.margin.count();
  json["deadline_ms"] = options.deadline.count();
  json["tries"] = options.tries;
  for (const auto& [key, member] : kChecks) {
    json["checks"][std::string(key)] = options.checks.*member;
  }
  return Dump(json);
}

Result<PostedPreview> PreviewFromJson(const std::string& text) {
  Result<nlohmann::json> parsed = ParseBody(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  // A channel may be a number.
  if (parsed->contains("light") && (*parsed)["light"].is_number_integer()) {
    (*parsed)["light"] = (*parsed)["light"].dump();
  }
  JsonReader json(*parsed, std::string(kRequest));
  PostedPreview posted = {.client = ReadClient(json)};
  const std::string kind = json.OptionalString("kind").value_or("preview");
  json.Require(kind == "preview", "kind", fmt::format("is '{}'; need preview", kind));
  PreviewRequest& request = posted.request;
  request.rig = ReadPath(json, "rig");
  posted.output = ReadPath(json, "output");
  request.light = json.OptionalString("light");
  request.exposure_s = json.OptionalNumber("exposure_s");
  Take(json.OptionalNumber("f_number"), request.f_number);
  Take(json.OptionalNumber("iso"), request.iso);
  Take(json.OptionalNumber("level"), request.level);
  Take(json.OptionalInteger("max_width"), request.max_width);
  Status status = FinishRequest(json);
  if (status) {
    status = request.Validate();
  }
  if (status && !posted.output.empty()) {
    status = CheckPreviewName(posted.output);
  }
  return status ? Result<PostedPreview>(std::move(posted)) : tl::unexpected(status.error());
}

std::string PreviewToJson(const PreviewRequest& request, const std::filesystem::path& output,
                          const std::string& client) {
  ordered_json json = FromClient(client);
  json["kind"] = "preview";
  if (!request.rig.empty()) {
    json["rig"] = request.rig.string();
  }
  if (!output.empty()) {
    json["output"] = output.string();
  }
  if (request.light) {
    json["light"] = *request.light;
  }
  if (request.exposure_s) {
    json["exposure_s"] = *request.exposure_s;
  }
  json["f_number"] = request.f_number;
  json["iso"] = request.iso;
  json["level"] = request.level;
  json["max_width"] = request.max_width;
  return Dump(json);
}

Result<PostedLight> LightFromJson(const std::string& text, int channel) {
  const Result<nlohmann::json> parsed = ParseBody(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kRequest));
  PostedLight posted = {.client = ReadClient(json), .request = {.channel = channel}};
  posted.request.name = json.OptionalString("name").value_or("");
  json.Require(posted.request.name.size() <= 100, "name", "is longer than 100 bytes");
  Take(json.OptionalNumber("level"), posted.request.level);
  json.Require(posted.request.level >= 0.0 && posted.request.level <= 1.0, "level",
               fmt::format("is {}; need 0 to 1", posted.request.level));
  posted.request.on_time = ReadTime(json, "for_ms");
  json.Require(!posted.request.on_time || posted.request.on_time->count() >= 1, "for_ms",
               "is 0; need at least 1 ms");
  const Status status = FinishRequest(json);
  return status ? Result<PostedLight>(std::move(posted)) : tl::unexpected(status.error());
}

std::string LightToJson(const LightRequest& request, const std::string& client) {
  ordered_json json = FromClient(client);
  if (!request.name.empty()) {
    json["name"] = request.name;
  }
  json["level"] = request.level;
  if (request.on_time) {
    json["for_ms"] = request.on_time->count();
  }
  return Dump(json);
}

Result<PostedBoardChange> BoardChangeFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseBody(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kRequest));
  PostedBoardChange posted = {.client = ReadClient(json)};
  BoardChange& change = posted.change;
  change.clear_fault = TakeFlag(json, "clear_fault");
  change.channel = json.OptionalInteger("channel");
  change.max_level = json.OptionalNumber("max_level");
  change.max_on = ReadTime(json, "max_on_ms");
  change.max_lit = json.OptionalInteger("max_lit");
  change.dim_clock = json.OptionalInteger("dim_clock");
  if (json.Has("sync_rising")) {
    change.sync_rising = json.Boolean("sync_rising");
  }
  const Status status = FinishRequest(json);
  return status ? Result<PostedBoardChange>(std::move(posted)) : tl::unexpected(status.error());
}

std::string BoardChangeToJson(const BoardChange& change, const std::string& client) {
  ordered_json json = FromClient(client);
  const auto put = [&](const char* key, const auto& value) {
    if (value) {
      json[key] = *value;
    }
  };
  json["clear_fault"] = change.clear_fault;
  put("channel", change.channel);
  put("max_level", change.max_level);
  if (change.max_on) {
    json["max_on_ms"] = change.max_on->count();
  }
  put("max_lit", change.max_lit);
  put("dim_clock", change.dim_clock);
  put("sync_rising", change.sync_rising);
  return Dump(json);
}

}  // namespace sateen
