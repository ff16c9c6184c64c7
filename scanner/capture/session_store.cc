#include "scanner/capture/session_store.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "core/check.h"
#include "core/files/file_exchange.h"
#include "core/files/file_io.h"
#include "core/files/output_folder.h"
#include "core/notice.h"
#include "core/sha256.h"
#include "scanner/capture/own_frames.h"
#include "scanner/capture/session_folder.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/frames/frame_loader.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

Status MakeFolder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) {
    return Fail(ErrorCode::kIo,
                "{}: cannot create this folder: {}; get write permission, or choose another folder",
                path.string(), error.message());
  }
  return {};
}

constexpr std::string_view kIncoming = ".sateen-incoming-";

// Removes what a killed capture left hidden.
void CleanUp(const fs::path& dir) {
  OwnFolder::Abandoned(dir, kIncoming, Notice).clear();
  CleanUpAfterKills(dir);
}

// Removes the frames of a journal that is begun again.
void RemoveBegun(const fs::path& dir) {
  if (const Result<std::optional<Journal>> former = ReadJournal(dir); former && *former) {
    RemoveFormerFrames(dir, **former);
  }
}

// Writes the session's copy of the rig, unless it is there.
Status SaveRig(const fs::path& dir, const std::string& text) {
  const fs::path place = dir / kSavedRigFile;
  const Result<std::string> there = Exists(place) ? ReadFileBytes(place) : std::string();
  return there && *there == text ? Status() : WriteFileWhole(place, text);
}

}  // namespace

Result<SessionStore> SessionStore::Begin(const fs::path& dir, const fs::path& rig_file,
                                         const CaptureOptions& options) {
  Result<Rig> rig = CheckBegin(dir, rig_file, options);
  const Result<std::string> rig_text = rig ? ReadFileBytes(rig_file) : tl::unexpected(rig.error());
  const Status made = rig_text ? MakeFolder(dir / kFramesFolder) : tl::unexpected(rig_text.error());
  if (!made) {
    return tl::unexpected(made.error());
  }
  const fs::path parent = fs::absolute(dir).lexically_normal().parent_path();
  Result<JournalWriter> writer =
      FlushToDisk(parent, parent).and_then([&] { return JournalWriter::Open(dir); });
  if (!writer) {
    return tl::unexpected(writer.error());
  }
  // Again, now that no other program can begin here; then what was there goes.
  const Status ready = CheckBegin(dir, rig_file, options)
                           .map([&](const Rig&) {
                             CleanUp(dir);
                             RemoveBegun(dir);
                           })
                           .and_then([&] { return writer->Keep(0); })
                           .and_then([&] { return SaveRig(dir, *rig_text); });
  Result<OwnFolder> incoming =
      ready ? OwnFolder::Make(dir, kIncoming) : tl::unexpected(ready.error());
  if (!incoming) {
    return tl::unexpected(incoming.error());
  }
  const Journal journal{.begun = {.kind = options.kind,
                                  .rig = kSavedRigFile,
                                  .rig_sha256 = Sha256(*rig_text),
                                  .exposure_s = options.exposure_s,
                                  .f_number = options.f_number,
                                  .iso = options.iso,
                                  .level = options.level,
                                  .brackets = options.brackets}};
  if (const Status begun = writer->Begin(journal.begun); !begun) {
    return tl::unexpected(begun.error());
  }
  return SessionStore(dir, *std::move(rig), journal, *std::move(writer), *std::move(incoming));
}

Result<SessionStore> SessionStore::Resume(const fs::path& dir) {
  Result<JournalWriter> writer =
      CheckResume(dir).and_then([&](const Journal&) { return JournalWriter::Open(dir); });
  // Again, now that no other program can go on here.
  Result<Journal> journal = writer ? CheckResume(dir) : tl::unexpected(writer.error());
  Result<Rig> rig = journal ? ReadRig(dir / journal->begun.rig) : tl::unexpected(journal.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (const Status kept = writer->Keep(journal->whole_bytes); !kept) {
    return tl::unexpected(kept.error());
  }
  std::optional<OwnFolder> incoming;
  CleanUp(dir);
  if (!journal->complete) {
    Result<OwnFolder> made = OwnFolder::Make(dir, kIncoming);
    if (!made) {
      return tl::unexpected(made.error());
    }
    incoming.emplace(*std::move(made));
  }
  return SessionStore(dir, *std::move(rig), *std::move(journal), *std::move(writer),
                      std::move(incoming));
}

Session SessionOf(const Journal& journal) {
  Session session{.kind = journal.begun.kind,
                  .rig = journal.begun.rig,
                  .rig_sha256 = journal.begun.rig_sha256,
                  .has_journal = true};
  for (const std::optional<SessionFrame>& frame : journal.done) {
    SATEEN_CHECK(frame.has_value());
    session.frames.push_back(*frame);
  }
  return session;
}

SessionStore::SessionStore(fs::path dir, Rig rig, Journal journal, JournalWriter writer,
                           std::optional<OwnFolder> incoming)
    : dir_(std::move(dir)),
      rig_(std::move(rig)),
      journal_(std::move(journal)),
      writer_(std::move(writer)),
      incoming_(std::move(incoming)),
      is_new_(journal_.done.size()) {}

FrameFile SessionStore::FileOf(const SessionFrame& frame) const {
  return {dir_ / frame.file, frame.Exposure(), frame.sha256, rig_.response};
}

std::vector<std::size_t> SessionStore::Open() const {
  std::vector<std::size_t> open;
  for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
    if (!journal_.done[frame]) {
      open.push_back(frame);
    }
  }
  return open;
}

int SessionStore::Taken() const { return static_cast<int>(std::ranges::count(is_new_, true)); }

bool SessionStore::HasSessionJson() const { return Exists(dir_ / kSessionFile); }

Status SessionStore::SetPlan(FramePlan plan, const std::string& reason,
                             const PlannedExposure& exposure) {
  return writer_.Planned(plan, reason, exposure).map([&] {
    if (exposure.is_new) {
      journal_.begun.exposure_s = exposure.exposure_s;
    }
    journal_.plan = std::move(plan);
    journal_.done.assign(journal_.plan.size(), std::nullopt);
    is_new_.assign(journal_.plan.size(), false);
  });
}

const fs::path& SessionStore::Incoming() const {
  SATEEN_CHECK(incoming_.has_value());
  return incoming_->Path();
}

Status SessionStore::BeginFrame(std::size_t frame) {
  return CheckFrameName(dir_, journal_, frame)
      .and_then([&] { return writer_.FrameBegun(frame); })
      .map([&] { journal_.begun_names.insert(FileNameOf(frame, journal_.plan[frame], {})); });
}

Status SessionStore::Place(const fs::path& delivered, const fs::path& place) {
  std::error_code error;
  fs::rename(delivered, place, error);
  if (error) {
    return Fail(ErrorCode::kIo, "{}: cannot move the frame here: {}", place.string(),
                error.message());
  }
  fs::remove_all(delivered.parent_path(), error);
  return FlushToDisk(place.parent_path(), place.parent_path());
}

Status SessionStore::KeepFrame(std::size_t frame, SessionFrame record, const fs::path& delivered) {
  return CheckFrameFile(dir_, journal_, record.file)
      .and_then([&] { return Place(delivered, dir_ / record.file); })
      .and_then([&] { return writer_.FrameDone(frame, record); })
      .map([&] {
        journal_.done_names.insert(record.file);
        journal_.done[frame] = std::move(record);
        is_new_[frame] = true;
      });
}

Status SessionStore::RejectFrame(std::size_t frame, const std::string& reason) {
  journal_.done[frame].reset();
  is_new_[frame] = false;
  ++rejected_;
  return writer_.FrameRejected(frame, reason);
}

Status SessionStore::VerifyDone() {
  for (std::size_t frame = 0; frame < journal_.done.size(); ++frame) {
    if (!journal_.done[frame]) {
      continue;
    }
    if (const Result<std::string> hash = CheckedHash(FileOf(*journal_.done[frame])); !hash) {
      if (journal_.complete) {
        return Fail(hash.error().code,
                    "{}\n{}: is a complete session, whose frames are not taken again; restore the "
                    "file, or capture again into another folder",
                    hash.error().message, dir_.string());
      }
      if (Status rejected = RejectFrame(frame, hash.error().message); !rejected) {
        return rejected;
      }
    }
  }
  return {};
}

Status SessionStore::Complete(const Session& session) {
  if (!journal_.complete) {
    RemoveFormerFrames(dir_, journal_);
    NameOtherFiles(dir_, journal_);
    if (Status completed = writer_.Complete(); !completed) {
      return completed;
    }
    journal_.complete = true;
  }
  return CheckNoLinks(dir_)
      .and_then([&] { return WriteFileWhole(dir_ / kSessionFile, SessionToJson(session)); })
      .map([&] { incoming_.reset(); });
}

}  // namespace sateen
