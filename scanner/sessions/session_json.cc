#include "scanner/sessions/session_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace sateen {
namespace {

constexpr std::array kKinds = {SessionKind::kFabric, SessionKind::kSheet, SessionKind::kChart,
                               SessionKind::kBoard};
constexpr std::array kRoles = {FrameRole::kLit, FrameRole::kDark, FrameRole::kRepeat};

constexpr double kMostShiftPx =
    100.0;  // largest shift that a capture may accept (FrameCheckOptions)

// The value whose name stands at `key`; the first one after a failure.
template <typename Enum, size_t N>
Enum ReadName(JsonReader& json, std::string_view key, const std::array<Enum, N>& values) {
  const std::string found = json.String(key);
  const auto match =
      std::find_if(values.begin(), values.end(), [&](Enum v) { return Name(v) == found; });
  std::vector<std::string_view> names;
  names.reserve(N);
  for (const Enum value : values) {
    names.push_back(Name(value));
  }
  json.Require(match != values.end(), key,
               fmt::format("is \"{}\"; need one of {}", found, fmt::join(names, ", ")));
  return match == values.end() ? values[0] : *match;
}

std::optional<double> ReadFactor(JsonReader& json, std::string_view key, double least,
                                 double most) {
  const std::optional<double> factor = json.OptionalNumber(key);
  const double value = factor.value_or(1.0);
  json.Require(value > 0.0 && value <= most, key,
               fmt::format("is {}; need more than 0 and at most {}", value, most));
  json.Require(value >= least, key, fmt::format("is {}; need at least {}", value, least));
  return factor;
}

}  // namespace

std::string_view Name(SessionKind kind) {
  switch (kind) {
    case SessionKind::kFabric:
      return "fabric";
    case SessionKind::kSheet:
      return "sheet";
    case SessionKind::kChart:
      return "chart";
    case SessionKind::kBoard:
      return "board";
  }
  return "";
}

std::string_view Name(FrameRole role) {
  switch (role) {
    case FrameRole::kLit:
      return "lit";
    case FrameRole::kDark:
      return "dark";
    case FrameRole::kRepeat:
      return "repeat";
  }
  return "";
}

std::optional<std::string> ReadHash(JsonReader& json, std::string_view key) {
  std::optional<std::string> hash = json.OptionalString(key);
  const bool is_hash = !hash || (hash->size() == 64 &&
                                 hash->find_first_not_of("0123456789abcdef") == std::string::npos);
  json.Require(is_hash, key, "is not a SHA-256; need 64 lower-case hexadecimal digits");
  return hash;
}

std::string ReadFileName(JsonReader& json, std::string_view key) {
  std::string name = json.String(key);
  json.Require(!name.empty(), key, "is empty; need a file");
  return name;
}

SessionKind ReadSessionKind(JsonReader& json, std::string_view key) {
  return ReadName(json, key, kKinds);
}

void ReadRoleAndLight(JsonReader& json, SessionFrame& frame) {
  frame.role = ReadName(json, "role", kRoles);
  if (frame.role != FrameRole::kDark) {
    frame.light = json.String("light");
    json.Require(!frame.light.empty(), "light", "is empty; need the name of a light of the rig");
  }
}

SessionFrame ReadSessionFrame(JsonReader& json) {
  SessionFrame frame;
  ReadRoleAndLight(json, frame);
  frame.file = ReadFileName(json, "file");
  frame.sha256 = ReadHash(json, "sha256");
  frame.exposure_s = ReadFactor(json, "exposure_s", 1e-9, 3600.0);
  frame.f_number = ReadFactor(json, "f_number", 0.1, 1000.0);
  frame.iso = ReadFactor(json, "iso", 1e-2, 1e7);
  if (const auto shift = json.OptionalNumbers("shift_px", 2)) {
    frame.shift_px = Eigen::Vector2d((*shift)[0], (*shift)[1]);
    json.Require(frame.shift_px->cwiseAbs().maxCoeff() <= kMostShiftPx, "shift_px",
                 fmt::format("is [{}, {}]; need at most {:g} px each", frame.shift_px->x(),
                             frame.shift_px->y(), kMostShiftPx));
  }
  return frame;
}

nlohmann::ordered_json RoleAndLightToJson(const SessionFrame& frame) {
  nlohmann::ordered_json json{{"role", Name(frame.role)}};
  if (frame.role != FrameRole::kDark) {
    json["light"] = frame.light;
  }
  return json;
}

nlohmann::ordered_json SessionFrameToJson(const SessionFrame& frame) {
  nlohmann::ordered_json json = RoleAndLightToJson(frame);
  json["file"] = frame.file;
  PutIfKnown(json, "sha256", frame.sha256);
  PutIfKnown(json, "exposure_s", frame.exposure_s);
  PutIfKnown(json, "f_number", frame.f_number);
  PutIfKnown(json, "iso", frame.iso);
  if (frame.shift_px) {
    json["shift_px"] = {frame.shift_px->x(), frame.shift_px->y()};
  }
  return json;
}

}  // namespace sateen
