#include <nlohmann/json.hpp>
#include <utility>

#include "core/json.h"
#include "core/whole_number.h"
#include "scanner/daemon/answer_json.h"

namespace sateen {
namespace {

using nlohmann::ordered_json;
using std::chrono::milliseconds;

constexpr auto kCounts = {std::pair{"bad_frames", &BoardReport::bad_frames},
                          std::pair{"overruns", &BoardReport::overruns},
                          std::pair{"refused", &BoardReport::refused},
                          std::pair{"repeats", &BoardReport::repeats},
                          std::pair{"unsent", &BoardReport::unsent},
                          std::pair{"syncs", &BoardReport::syncs},
                          std::pair{"flashes", &BoardReport::flashes},
                          std::pair{"faults", &BoardReport::faults}};

milliseconds ReadMs(JsonReader& json, std::string_view key) {
  return milliseconds(ClampedTo<std::int64_t>(json.Number(key)));
}

BoardState ReadState(JsonReader& json) {
  BoardState state;
  state.fault = json.Integer("fault");
  state.lit = static_cast<unsigned>(json.Integer("lit"));
  state.level = json.Number("level");
  state.lit_for = ReadMs(json, "lit_for_ms");
  state.left = ReadMs(json, "left_ms");
  state.armed = json.Integer("armed");
  state.shutter = ReadMs(json, "shutter_ms");
  return state;
}

}  // namespace

std::string LitJson(const BoardState& state) {
  return JsonText(ordered_json({{"lit", LitChannels(state.lit)}}));
}

Status NoneLitFromJson(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (json.is_object() && json.value("lit", nlohmann::json()) == nlohmann::json::array()) {
    return {};
  }
  return Fail(
      ErrorCode::kDevice,
      "the daemon does not say that all lights are off; a job still runs, or a light is on: "
      "look at the lights, and at 'sateen light status'");
}

std::string BoardJson(const BoardWord& board) {
  const BoardInfo& info = board.info;
  const BoardReport& report = board.report;
  const BoardState& state = report.state;
  ordered_json limits = ordered_json::array();
  for (const LightLimits& light : info.lights) {
    limits.push_back({{"max_level", light.max_level}, {"max_on_ms", light.max_on.count()}});
  }
  ordered_json json = {{"port", board.port},
                       {"firmware", info.build_id},
                       {"protocol", info.protocol},
                       {"max_lit", info.settings.max_lit},
                       {"dim_clock", info.settings.dim_clock},
                       {"sync_rising", info.settings.sync_rising},
                       {"limits", limits},
                       {"state",
                        {{"fault", state.fault},
                         {"lit", state.lit},
                         {"level", state.level},
                         {"lit_for_ms", state.lit_for.count()},
                         {"left_ms", state.left.count()},
                         {"armed", state.armed},
                         {"shutter_ms", state.shutter.count()}}},
                       {"reset_cause", report.reset_cause},
                       {"uptime_ms", report.uptime.count()},
                       {"frames", report.frames}};
  for (const auto& [key, member] : kCounts) {
    json[key] = report.*member;
  }
  return JsonText(json);
}

Result<BoardWord> BoardFromJson(const std::string& text) {
  const std::string where = "answer of the daemon";
  const Result<nlohmann::json> parsed = ParseJson(text, where);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  if (!parsed->is_object()) {
    return Fail(ErrorCode::kBadData, "{} is no JSON object", where);
  }
  JsonReader json(*parsed, where);
  BoardWord board = {.port = json.String("port")};
  board.info.build_id = json.String("firmware");
  board.info.protocol = json.String("protocol");
  board.info.settings = {.max_lit = json.Integer("max_lit"),
                         .dim_clock = json.Integer("dim_clock"),
                         .sync_rising = json.Boolean("sync_rising")};
  Status status;
  for (JsonReader& light : json.Objects("limits")) {
    board.info.lights.push_back(
        {.max_level = light.Number("max_level"), .max_on = ReadMs(light, "max_on_ms")});
    status = status ? light.Finish() : status;
  }
  JsonReader state = json.Object("state");
  board.report.state = ReadState(state);
  status = status ? state.Finish() : status;
  board.report.reset_cause = json.String("reset_cause");
  board.report.uptime = ReadMs(json, "uptime_ms");
  board.report.frames = ClampedTo<std::uint32_t>(json.Number("frames"));
  for (const auto& [key, member] : kCounts) {
    board.report.*member = ClampedTo<unsigned>(json.Number(key));
  }
  board.info.reset_cause = board.report.reset_cause;
  board.info.fault = board.report.state.fault;
  if (const Status rest = json.Finish(); !rest) {
    return tl::unexpected(rest.error());
  }
  return status ? Result<BoardWord>(std::move(board)) : tl::unexpected(status.error());
}

}  // namespace sateen
