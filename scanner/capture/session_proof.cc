#include "scanner/capture/session_proof.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "core/sha256.h"
#include "scanner/capture/journal.h"
#include "scanner/capture/session_folder.h"
#include "scanner/capture/session_store.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frames/frame_loader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

// Goes through a session and collects its faults.
class Prover {
 public:
  Prover(const fs::path& dir, const Task& task) : dir_(dir), task_(task) {}

  Result<SessionProof> Prove() {
    const Result<Session> session = ReadSessionRecord(dir_);
    if (!Take(session)) {
      return std::move(proof_);
    }
    CheckRig(*session);
    CheckAgainstJournal(*session);
    task_.BeginStage("verifying", static_cast<int>(session->frames.size()));
    for (const SessionFrame& frame : session->frames) {
      if (const Status going = task_.CheckCancelled(); !going) {
        return tl::unexpected(going.error());
      }
      CheckFile(frame);
      task_.Advance();
    }
    if (session->mask) {
      (void)IsInside(*session->mask);
    }
    return std::move(proof_);
  }

 private:
  template <typename T>
  bool Take(const Result<T>& result) {
    if (!result) {
      proof_.faults.push_back(result.error().message);
    }
    return result.has_value();
  }

  template <typename... Args>
  void Add(fmt::format_string<Args...> text, Args&&... args) {
    proof_.faults.push_back(fmt::format(text, std::forward<Args>(args)...));
  }

  // Adds a fault for a file that does not come along where the session is moved or copied.
  bool IsInside(const std::string& name) {
    if (!LeadsOutOf(dir_, name)) {
      return true;
    }
    Add("{}: {} lies outside of the session, which is not whole without it; copy the file into the "
        "session's folder and name it there",
        (dir_ / kSessionFile).string(), name);
    return false;
  }

  void CheckRig(const Session& session) {
    if (session.has_journal && !IsInside(session.rig)) {
      return;
    }
    const FrameFile file{.path = dir_ / session.rig, .sha256 = session.rig_sha256};
    if (!Take(CheckedHash(file))) {
      return;
    }
    proof_.files += session.rig_sha256 ? 1 : 0;
    if (const Result<Rig> rig = ReadRig(file.path); Take(rig)) {
      CheckEveryLight(session, *rig);
    }
  }

  // Adds a fault for each light without a lit frame, in sessions of fabric and sheets.
  void CheckEveryLight(const Session& session, const Rig& rig) {
    if (session.kind == SessionKind::kChart || session.kind == SessionKind::kBoard) {
      return;
    }
    for (const Light& light : rig.lights) {
      const bool has_frame = std::ranges::any_of(session.frames, [&](const SessionFrame& frame) {
        return frame.role == FrameRole::kLit && frame.light == light.name;
      });
      if (!has_frame) {
        Add("{}: has no frame of light '{}'; need one", (dir_ / kSessionFile).string(), light.name);
      }
    }
  }

  // Adds a fault where the journal is not of this very session.
  void CheckAgainstJournal(const Session& session) {
    const fs::path path = dir_ / kJournalFile;
    if (!Exists(path)) {
      if (session.has_journal) {
        Add("{}: is missing, but session.json refers to it; restore it, or capture again",
            path.string());
      }
      return;
    }
    const Result<std::optional<Journal>> journal = ReadJournal(dir_);
    if (!Take(journal)) {
      return;
    }
    if (!*journal) {
      Add("{}: has no complete line; restore it, or capture again", path.string());
    } else if (!(*journal)->complete) {
      Add("{}: the capture is not complete; continue it: sateen capture --resume {}", path.string(),
          dir_.string());
    } else if (Comparable(SessionOf(**journal)) != Comparable(session)) {
      Add("{}: has other frames than session.json; one of the two was changed: restore it, or "
          "capture again",
          path.string());
    }
  }

  // Returns the session without what is found at the end of a capture, and what a person may add.
  static std::string Comparable(Session session) {
    for (SessionFrame& frame : session.frames) {
      frame.shift_px.reset();
    }
    session.mask.reset();
    session.table_from_sheet.reset();
    session.has_journal = true;  // earlier captures did not say so
    return SessionToJson(session);
  }

  void CheckFile(const SessionFrame& frame) {
    if (!IsInside(frame.file)) {
      return;
    }
    if (!frame.sha256) {
      Add("{}: {} has no hash and cannot be verified", (dir_ / kSessionFile).string(), frame.file);
    } else if (Take(CheckedHash({.path = dir_ / frame.file, .sha256 = frame.sha256}))) {
      ++proof_.files;
    }
  }

  const fs::path& dir_;
  const Task& task_;
  SessionProof proof_;
};

}  // namespace

Result<SessionProof> ProveSession(const fs::path& dir, const Task& task) {
  std::error_code error;
  if (!fs::is_directory(dir, error)) {
    return Fail(ErrorCode::kIo, "{}: {}; name the folder of a session", dir.string(),
                Exists(dir) ? "is not a folder" : "there is no such folder");
  }
  return Prover(dir, task).Prove();
}

Result<int> VerifySession(const fs::path& dir, const Task& task) {
  const Result<SessionProof> proof = ProveSession(dir, task);
  if (!proof) {
    return tl::unexpected(proof.error());
  }
  if (!proof->faults.empty()) {
    return Fail(ErrorCode::kBadData, "{}", fmt::join(proof->faults, "\n"));
  }
  return proof->files;
}

}  // namespace sateen
