#include "scanner/session.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/json.h"
#include "scanner/folder_listing.h"
#include "scanner/pose_json.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr std::array kKinds = {SessionKind::kFabric, SessionKind::kSheet, SessionKind::kChart,
                               SessionKind::kBoard};
constexpr std::array kRoles = {FrameRole::kLit, FrameRole::kDark};

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

std::optional<std::string> ReadHash(JsonReader& json, std::string_view key) {
  std::optional<std::string> hash = json.OptionalString(key);
  const bool is_hash = !hash || (hash->size() == 64 &&
                                 hash->find_first_not_of("0123456789abcdef") == std::string::npos);
  json.Require(is_hash, key, "is no SHA-256; need 64 lower-case hexadecimal digits");
  return hash;
}

std::optional<double> ReadFactor(JsonReader& json, std::string_view key, double most) {
  const std::optional<double> factor = json.OptionalNumber(key);
  const double value = factor.value_or(1.0);
  json.Require(value > 0.0 && value <= most, key,
               fmt::format("is {}; need more than 0 and at most {}", value, most));
  return factor;
}

std::string ReadFileName(JsonReader& json, std::string_view key) {
  std::string name = json.String(key);
  json.Require(!name.empty(), key, "is empty; need a file");
  return name;
}

SessionFrame ReadFrame(JsonReader& json) {
  SessionFrame frame;
  frame.role = ReadName(json, "role", kRoles);
  if (frame.role == FrameRole::kLit) {
    frame.light = json.String("light");
    json.Require(!frame.light.empty(), "light", "is empty; need the name of a light of the rig");
  }
  frame.file = ReadFileName(json, "file");
  frame.sha256 = ReadHash(json, "sha256");
  frame.exposure_s = ReadFactor(json, "exposure_s", 3600.0);
  frame.f_number = ReadFactor(json, "f_number", 1000.0);
  frame.iso = ReadFactor(json, "iso", 1e7);
  return frame;
}

// With a factor known for some frames only, the others would come out in another unit.
Status CheckFactors(const std::vector<SessionFrame>& frames, const std::string& where) {
  using Factor = std::pair<const char*, std::optional<double> SessionFrame::*>;
  for (const auto& [key, factor] :
       {Factor{"exposure_s", &SessionFrame::exposure_s},
        Factor{"f_number", &SessionFrame::f_number}, Factor{"iso", &SessionFrame::iso}}) {
    for (size_t i = 1; i < frames.size(); ++i) {
      if ((frames[i].*factor).has_value() != (frames[0].*factor).has_value()) {
        const bool has = (frames[i].*factor).has_value();
        return Fail(ErrorCode::kBadData,
                    "{}: frames[{}] has {} but frames[{}] has not; give it for every frame or "
                    "for none",
                    where, has ? i : 0, key, has ? 0 : i);
      }
    }
  }
  return {};
}

Status CheckFileThere(const fs::path& dir) {
  if (Exists(dir / "session.json") || !Exists(dir / "journal.jsonl")) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{}: found journal.jsonl but no session.json: the capture was not completed; "
              "complete it or capture again",
              dir.string());
}

Result<Session> FromJson(const nlohmann::json& file, const std::string& where) {
  JsonReader json(file, where);
  Session session;
  session.kind = ReadName(json, "kind", kKinds);
  session.rig = ReadFileName(json, "rig");
  session.rig_sha256 = ReadHash(json, "rig_sha256");
  session.table_from_sheet = ReadTransform(json, "table_from_sheet");
  session.mask = json.OptionalString("mask");
  std::vector<JsonReader> frames = json.Objects("frames");
  json.Require(!frames.empty(), "frames", "is empty; need at least one frame");
  if (const Status status = json.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  for (JsonReader& frame : frames) {
    session.frames.push_back(ReadFrame(frame));
    if (const Status status = frame.Finish(); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (const Status status = CheckFactors(session.frames, where); !status) {
    return tl::unexpected(status.error());
  }
  return session;
}

template <typename T>
void PutIfKnown(nlohmann::ordered_json& json, const char* key, const std::optional<T>& value) {
  if (value) {
    json[key] = *value;
  }
}

nlohmann::ordered_json FrameToJson(const SessionFrame& frame) {
  nlohmann::ordered_json json{{"role", Name(frame.role)}};
  if (frame.role == FrameRole::kLit) {
    json["light"] = frame.light;
  }
  json["file"] = frame.file;
  PutIfKnown(json, "sha256", frame.sha256);
  PutIfKnown(json, "exposure_s", frame.exposure_s);
  PutIfKnown(json, "f_number", frame.f_number);
  PutIfKnown(json, "iso", frame.iso);
  return json;
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

std::string_view Name(FrameRole role) { return role == FrameRole::kLit ? "lit" : "dark"; }

double SessionFrame::Exposure() const {
  const double aperture = f_number.value_or(1.0);
  return exposure_s.value_or(1.0) * (iso.value_or(100.0) / 100.0) / (aperture * aperture);  // (1)
}

Result<Session> ReadSession(const fs::path& dir) {
  if (const Status status = CheckFileThere(dir); !status) {
    return tl::unexpected(status.error());
  }
  const fs::path path = dir / "session.json";
  const Result<nlohmann::json> file = ReadJsonFile(path, "sateen.session", 1);
  if (!file) {
    return tl::unexpected(file.error());
  }
  return FromJson(*file, path.string());
}

std::string SessionToJson(const Session& session) {
  nlohmann::ordered_json json{
      {"schema", "sateen.session/1"}, {"kind", Name(session.kind)}, {"rig", session.rig}};
  PutIfKnown(json, "rig_sha256", session.rig_sha256);
  json["frames"] = nlohmann::ordered_json::array();
  for (const SessionFrame& frame : session.frames) {
    json["frames"].push_back(FrameToJson(frame));
  }
  if (session.table_from_sheet) {
    json["table_from_sheet"] = RowMajor(*session.table_from_sheet);
  }
  PutIfKnown(json, "mask", session.mask);
  // A file name that is not UTF-8 must not end the run; reading will say that it is not there.
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace sateen
