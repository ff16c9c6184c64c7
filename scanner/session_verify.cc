#include <algorithm>

#include "core/sha256.h"
#include "scanner/capture_session.h"
#include "scanner/folder_listing.h"
#include "scanner/frame_loader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

// The journal tells of this very session.
Status CheckAgainstJournal(const fs::path& dir, const Session& session) {
  if (!Exists(dir / kJournalFile)) {
    return {};
  }
  const Result<std::optional<Journal>> journal = ReadJournal(dir);
  if (!journal) {
    return tl::unexpected(journal.error());
  }
  const std::string where = (dir / kJournalFile).string();
  if (!*journal || !(*journal)->complete) {
    return Fail(ErrorCode::kBadData, "{}: does not say that the capture is complete; capture again",
                where);
  }
  const auto without_shifts = [](Session of) {
    for (SessionFrame& frame : of.frames) {
      frame.shift_px.reset();  // is found when all is captured, and no record of the capture
    }
    of.mask.reset();  // a person may add these
    of.table_from_sheet.reset();
    return SessionToJson(of);
  };
  if (without_shifts(SessionOf(**journal)) != without_shifts(session)) {
    return Fail(ErrorCode::kBadData,
                "{}: tells of other frames than session.json; one of the two has been changed",
                where);
  }
  return {};
}

// Of fabric and sheets, each light has a lit frame, or several of different exposures.
Status CheckEveryLight(const fs::path& dir, const Session& session, const Rig& rig) {
  if (session.kind == SessionKind::kChart || session.kind == SessionKind::kBoard) {
    return {};
  }
  for (const Light& light : rig.lights) {
    const bool has_frame = std::ranges::any_of(session.frames, [&](const SessionFrame& frame) {
      return frame.role == FrameRole::kLit && frame.light == light.name;
    });
    if (!has_frame) {
      return Fail(ErrorCode::kBadData, "{}: has no frame of light '{}'; need one",
                  (dir / "session.json").string(), light.name);
    }
  }
  return {};
}

Result<int> Verify(const fs::path& dir, const Task& task) {
  const Result<Session> session = ReadSessionRecord(dir);
  if (!session) {
    return tl::unexpected(session.error());
  }
  const Result<std::string> rig_hash =
      CheckedHash({.path = dir / session->rig, .sha256 = session->rig_sha256});
  const Result<Rig> rig = rig_hash ? ReadRig(dir / session->rig) : tl::unexpected(rig_hash.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  const Status agrees = CheckAgainstJournal(dir, *session).and_then([&] {
    return CheckEveryLight(dir, *session, *rig);
  });
  if (!agrees) {
    return tl::unexpected(agrees.error());
  }
  task.BeginStage("verifying", static_cast<int>(session->frames.size()));
  int hashed = session->rig_sha256 ? 1 : 0;
  for (const SessionFrame& frame : session->frames) {
    if (const Status going = task.CheckCancelled(); !going) {
      return tl::unexpected(going.error());
    }
    if (!frame.sha256) {
      return Fail(ErrorCode::kBadData, "{}: {} has no hash; it cannot be proved",
                  (dir / "session.json").string(), frame.file);
    }
    const Result<std::string> hash =
        CheckedHash({.path = dir / frame.file, .sha256 = frame.sha256});
    if (!hash) {
      return tl::unexpected(hash.error());
    }
    ++hashed;
    task.Advance();
  }
  return hashed;
}

}  // namespace

Result<int> VerifySession(const fs::path& dir, const Task& task) {
  Result<int> verified = Verify(dir, task);
  if (!verified && verified.error().code == ErrorCode::kIo) {
    verified.error().code = ErrorCode::kBadData;  // what cannot be read is not whole
  }
  return verified;
}

}  // namespace sateen
