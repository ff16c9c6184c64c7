#include "scanner/sessions/session.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "core/json.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/files/pose_json.h"
#include "scanner/sessions/session_json.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kJournalName = "journal.jsonl";

// Fails if a factor is known for some frames only: the others would come out in another unit.
Status CheckFactors(const std::vector<SessionFrame>& frames, const std::string& where) {
  using Factor = std::pair<const char*, std::optional<double> SessionFrame::*>;
  for (const auto& [key, factor] :
       {Factor{"exposure_s", &SessionFrame::exposure_s},
        Factor{"f_number", &SessionFrame::f_number}, Factor{"iso", &SessionFrame::iso}}) {
    for (size_t i = 1; i < frames.size(); ++i) {
      if ((frames[i].*factor).has_value() != (frames[0].*factor).has_value()) {
        const bool has = (frames[i].*factor).has_value();
        return Fail(ErrorCode::kBadData,
                    "{}: frames[{}] has {} but frames[{}] does not; give it for every frame or "
                    "for none",
                    where, has ? i : 0, key, has ? 0 : i);
      }
    }
  }
  return {};
}

Status CheckFileThere(const fs::path& dir) {
  if (Exists(dir / "session.json") || !Exists(dir / kJournalName)) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{}: found journal.jsonl but no session.json: the capture was not completed; "
              "continue it: sateen capture --resume {}",
              dir.string(), dir.string());
}

Result<Session> FromJson(const nlohmann::json& file, const std::string& where) {
  JsonReader json(file, where);
  Session session;
  session.kind = ReadSessionKind(json, "kind");
  session.rig = ReadFileName(json, "rig");
  session.rig_sha256 = ReadHash(json, "rig_sha256");
  session.table_from_sheet = ReadTransform(json, "table_from_sheet");
  session.mask = json.OptionalString("mask");
  if (const std::optional<std::string> journal = json.OptionalString("journal")) {
    json.Require(*journal == kJournalName, "journal",
                 fmt::format("is \"{}\"; need \"{}\"", *journal, kJournalName));
    session.has_journal = true;
  }
  std::vector<JsonReader> frames = json.Objects("frames");
  json.Require(!frames.empty(), "frames", "is empty; need at least one frame");
  if (const Status status = json.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  for (JsonReader& frame : frames) {
    session.frames.push_back(ReadSessionFrame(frame));
    if (const Status status = frame.Finish(); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (const Status status = CheckFactors(session.frames, where); !status) {
    return tl::unexpected(status.error());
  }
  return session;
}

}  // namespace

double SessionFrame::Exposure() const {
  const double aperture = f_number.value_or(1.0);
  return exposure_s.value_or(1.0) * (iso.value_or(100.0) / 100.0) / (aperture * aperture);  // (1)
}

Result<Session> ReadSession(const fs::path& dir) {
  return ReadSessionRecord(dir).map([](Session session) {
    std::erase_if(session.frames,
                  [](const SessionFrame& frame) { return frame.role == FrameRole::kRepeat; });
    return session;
  });
}

Result<Session> ReadSessionRecord(const fs::path& dir) {
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
    json["frames"].push_back(SessionFrameToJson(frame));
  }
  if (session.table_from_sheet) {
    json["table_from_sheet"] = RowMajor(*session.table_from_sheet);
  }
  PutIfKnown(json, "mask", session.mask);
  if (session.has_journal) {
    json["journal"] = kJournalName;
  }
  // A file name that is not UTF-8 must not end the run; reading will say that it is not there.
  return JsonText(json, 2) + "\n";
}

}  // namespace sateen
