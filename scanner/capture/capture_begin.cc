// How a CaptureSession comes to be: begun, or gone on with.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <system_error>
#include <utility>

#include "core/file_io.h"
#include "core/output_folder.h"
#include "core/sha256.h"
#include "scanner/capture/capture_session.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRigFile = "rig.json";

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

// The folder that is there already of those that lead to `dir` can be written to.
Status CheckPlace(const fs::path& dir) {
  std::error_code ignored;
  fs::path place = fs::absolute(dir).lexically_normal();
  while (!fs::exists(place, ignored) && place.has_relative_path()) {
    place = place.parent_path();
  }
  errno = 0;
  if (fs::is_directory(place, ignored) && access(place.c_str(), W_OK | X_OK) == 0) {
    return {};
  }
  return Fail(ErrorCode::kIo,
              "{}: cannot be written to: {}; get write permission, or choose another folder",
              place.string(), std::generic_category().message(errno != 0 ? errno : ENOTDIR));
}

std::size_t FilesIn(const fs::path& dir) {
  std::error_code ignored;
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(dir, ignored), fs::directory_iterator()));
}

// Frames of which no journal tells: of a session that has lost it, or somebody's.
Status CheckNoStrangers(const fs::path& dir) {
  const std::size_t files = Exists(dir / kJournalFile) ? 0 : FilesIn(dir / "frames");
  return files == 0 ? Status()
                    : Fail(ErrorCode::kInvalidArgument,
                           "{}: holds {} files, and no {} tells of them; restore it, or choose "
                           "another folder",
                           (dir / "frames").string(), files, kJournalFile);
}

// Each light has a channel of its own, or two frames would be of one light.
Status CheckLights(const Rig& rig, const fs::path& file) {
  const Lights& lights = rig.lights;
  if (lights.empty()) {
    return Fail(ErrorCode::kBadData, "{}: has no lights; give it their names and channels",
                file.string());
  }
  for (size_t k = 0; k < lights.size(); ++k) {
    for (size_t j = 0; j < k; ++j) {
      if (lights[j].channel == lights[k].channel) {
        return Fail(ErrorCode::kBadData,
                    "{}: lights '{}' and '{}' both have channel {}; need one each", file.string(),
                    lights[j].name, lights[k].name, lights[k].channel);
      }
    }
  }
  return {};
}

// A journal without a frame that is done has nothing to lose: killed before, or without a camera.
bool HasFrames(const fs::path& dir) {
  if (!Exists(dir / kJournalFile)) {
    return false;
  }
  const Result<std::optional<Journal>> journal = ReadJournal(dir);
  return !journal || (*journal && std::ranges::any_of((*journal)->done, [](const auto& frame) {
    return frame.has_value();
  }));
}

bool IsPlanOf(const Rig& rig, const FramePlan& plan) {
  std::vector<double> exposures_s;
  for (const SessionFrame& frame : plan) {
    if (frame.role == FrameRole::kLit && !rig.lights.empty() &&
        frame.light == rig.lights.front().name) {
      exposures_s.push_back(*frame.exposure_s);
    }
  }
  return !exposures_s.empty() &&
         std::ranges::equal(plan, PlanOf(rig, exposures_s), [](const auto& a, const auto& b) {
           return a.role == b.role && a.light == b.light && a.exposure_s == b.exposure_s;
         });
}

}  // namespace

Result<Rig> CaptureSession::CheckBegin(const fs::path& dir, const fs::path& rig_file,
                                       const CaptureOptions& options) {
  Result<Rig> rig = options.Validate().and_then([&] { return ReadRig(rig_file); });
  Status status = rig ? CheckLights(*rig, rig_file) : tl::unexpected(rig.error());
  if (status && (Exists(dir / "session.json") || HasFrames(dir))) {
    status =
        Fail(ErrorCode::kInvalidArgument,
             "{}: holds a session already; choose another folder, or go on with it: sateen capture "
             "--resume {}",
             dir.string(), dir.string());
  }
  status = status.and_then([&] { return CheckNoStrangers(dir); }).and_then([&] {
    return CheckPlace(dir);
  });
  return status ? std::move(rig) : tl::unexpected(status.error());
}

Result<CaptureSession> CaptureSession::Begin(const fs::path& dir, const fs::path& rig_file,
                                             const CaptureOptions& options) {
  Result<Rig> rig = CheckBegin(dir, rig_file, options);
  const Result<std::string> rig_text = rig ? ReadFileBytes(rig_file) : tl::unexpected(rig.error());
  const Status made = rig_text ? MakeFolder(dir / "frames") : tl::unexpected(rig_text.error());
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
                           .and_then([&](const Rig&) { return writer->Keep(0); })
                           .and_then([&] { return WriteFileWhole(dir / kRigFile, *rig_text); });
  if (!ready) {
    return tl::unexpected(ready.error());
  }
  const Journal journal{.begun = {.kind = options.kind,
                                  .rig = kRigFile,
                                  .rig_sha256 = Sha256(*rig_text),
                                  .exposure_s = options.exposure_s,
                                  .f_number = options.f_number,
                                  .iso = options.iso,
                                  .level = options.level,
                                  .brackets = options.brackets}};
  if (const Status begun = writer->Begin(journal.begun); !begun) {
    return tl::unexpected(begun.error());
  }
  return CaptureSession(dir, *std::move(rig), journal, *std::move(writer), options);
}

Result<Journal> CaptureSession::CheckResume(const fs::path& dir) {
  if (!Exists(dir / kJournalFile)) {
    return Fail(ErrorCode::kIo, "{}: is not there; nothing was captured",
                (dir / kJournalFile).string());
  }
  Result<std::optional<Journal>> read = ReadJournal(dir);
  if (!read) {
    return tl::unexpected(read.error());
  }
  if (!*read) {
    return Fail(ErrorCode::kBadData, "{}: nothing was captured yet; begin anew, with --rig and -o",
                dir.string());
  }
  const Journal& journal = **read;
  const fs::path rig_file = dir / journal.begun.rig;
  const Result<std::string> hash = Sha256OfFile(rig_file);
  const Result<Rig> rig = hash ? ReadRig(rig_file) : tl::unexpected(hash.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (*hash != journal.begun.rig_sha256) {
    return Fail(ErrorCode::kBadData,
                "{}: is not the rig that this capture began with; restore it, or capture anew",
                rig_file.string());
  }
  if (!journal.plan.empty() && !IsPlanOf(*rig, journal.plan)) {
    return Fail(ErrorCode::kBadData, "{}: plans other frames than this program takes; capture anew",
                (dir / kJournalFile).string());
  }
  return **std::move(read);
}

Result<CaptureSession> CaptureSession::Resume(const fs::path& dir, const CaptureOptions& options) {
  Status ready =
      options.Validate().and_then([&] { return CheckResume(dir).map([](const Journal&) {}); });
  Result<JournalWriter> writer = ready ? JournalWriter::Open(dir) : tl::unexpected(ready.error());
  // Again, now that no other program can go on here.
  Result<Journal> journal = writer ? CheckResume(dir) : tl::unexpected(writer.error());
  Result<Rig> rig = journal ? ReadRig(dir / journal->begun.rig) : tl::unexpected(journal.error());
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  if (const Status kept = writer->Keep(journal->whole_bytes); !kept) {
    return tl::unexpected(kept.error());
  }
  return CaptureSession(dir, *std::move(rig), *std::move(journal), *std::move(writer), options);
}

Status CaptureSession::CompleteSession(const fs::path& dir) {
  return Fail(ErrorCode::kInvalidArgument,
              "{}: is a complete session, whose exposure cannot change; capture anew, into another "
              "folder",
              dir.string());
}

Status CaptureSession::ChangeExposure(std::optional<double> exposure_s) {
  if (journal_.complete) {
    return CompleteSession(dir_);
  }
  asked_anew_ = AskedAnew{exposure_s};
  return {};
}

}  // namespace sateen
