#include "scanner/capture/session_folder.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <system_error>
#include <utility>

#include "core/sha256.h"
#include "scanner/capture/own_frames.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

// Fails unless the deepest folder on the way to `dir` that exists can be written to.
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

// Fails if there are frames without a journal: the session has lost it, or they are not ours.
Status CheckNoStrangers(const fs::path& dir) {
  const std::size_t files = Exists(dir / kJournalFile) ? 0 : FilesIn(dir / kFramesFolder);
  return files == 0 ? Status()
                    : Fail(ErrorCode::kInvalidArgument,
                           "{}: holds {} files but there is no {} of them; restore it, or choose "
                           "another folder",
                           (dir / kFramesFolder).string(), files, kJournalFile);
}

// Fails unless each light has its own channel: else two frames would show one light.
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

// Returns false where the journal has no frame that is done, so that there is nothing to lose.
bool HasFrames(const fs::path& dir) {
  if (!Exists(dir / kJournalFile)) {
    return false;
  }
  const Result<std::optional<Journal>> journal = ReadJournal(dir);
  return !journal || (*journal && std::ranges::any_of((*journal)->done, [](const auto& frame) {
    return frame.has_value();
  }));
}

// Fails where the session's copy of the rig would replace a rig that is not a copy of a capture.
Status CheckRigPlace(const fs::path& dir, const fs::path& rig_file) {
  const fs::path place = dir / kSavedRigFile;
  if (!Exists(place)) {
    return {};
  }
  const Result<std::string> there = Sha256OfFile(place);
  const Result<std::string> wanted = there ? Sha256OfFile(rig_file) : there;
  if (!wanted) {
    return tl::unexpected(wanted.error());
  }
  const Result<std::optional<Journal>> former =
      Exists(dir / kJournalFile) ? ReadJournal(dir) : std::optional<Journal>();
  const bool is_copy = former && *former && (*former)->begun.rig_sha256 == *there;
  if (*there == *wanted || is_copy) {
    return {};
  }
  return Fail(ErrorCode::kInvalidArgument,
              "{}: is another rig than {}, and the session keeps a copy of its rig there; choose "
              "another folder, or move it away",
              place.string(), rig_file.string());
}

}  // namespace

Result<Rig> CheckBegin(const fs::path& dir, const fs::path& rig_file,
                       const CaptureOptions& options) {
  Result<Rig> rig = options.Validate().and_then([&] { return ReadRig(rig_file); });
  Status status = rig ? CheckLights(*rig, rig_file) : tl::unexpected(rig.error());
  status = status.and_then([&] { return CheckNoLinks(dir); });
  if (status && (Exists(dir / kSessionFile) || HasFrames(dir))) {
    status =
        Fail(ErrorCode::kInvalidArgument,
             "{}: holds a session already; choose another folder, or continue it: sateen capture "
             "--resume {}",
             dir.string(), dir.string());
  }
  status = status.and_then([&] { return CheckNoStrangers(dir); })
               .and_then([&] { return CheckRigPlace(dir, rig_file); })
               .and_then([&] { return CheckPlace(dir); });
  return status ? std::move(rig) : tl::unexpected(status.error());
}

Result<Journal> CheckResume(const fs::path& dir) {
  if (const Status own = CheckNoLinks(dir); !own) {
    return tl::unexpected(own.error());
  }
  if (!Exists(dir / kJournalFile)) {
    return Fail(ErrorCode::kIo, "{}: does not exist; nothing was captured",
                (dir / kJournalFile).string());
  }
  Result<std::optional<Journal>> read = ReadJournal(dir);
  if (!read) {
    return tl::unexpected(read.error());
  }
  if (!*read) {
    return Fail(ErrorCode::kBadData, "{}: nothing was captured yet; begin again with --rig and -o",
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
                "{}: is not the rig that this capture began with; restore it, or capture again",
                rig_file.string());
  }
  if (!journal.plan.empty() && !IsPlanOf(*rig, journal.plan)) {
    return Fail(ErrorCode::kBadData, "{}: its plan is not one of this program; capture again",
                (dir / kJournalFile).string());
  }
  return **std::move(read);
}

Error CompleteSessionError(const fs::path& dir) {
  return {ErrorCode::kInvalidArgument,
          fmt::format("{}: is a complete session, whose exposure cannot change; capture again into "
                      "another folder",
                      dir.string())};
}

}  // namespace sateen
