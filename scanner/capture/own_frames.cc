#include "scanner/capture/own_frames.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "core/notice.h"
#include "imaging/raw.h"
#include "scanner/capture/session_folder.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostNames = 5;  // in a notice

bool IsLink(const fs::path& path) {
  std::error_code ignored;
  return fs::is_symlink(fs::symlink_status(path, ignored));
}

// Returns the entries of frames/, in order; nothing where it is a link.
std::vector<fs::directory_entry> EntriesOf(const fs::path& dir) {
  std::vector<fs::directory_entry> entries;
  const fs::path frames = dir / kFramesFolder;
  if (IsLink(frames)) {
    return entries;
  }
  std::error_code ignored;
  for (fs::directory_iterator entry(frames, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    entries.push_back(*entry);
  }
  std::ranges::sort(entries);
  return entries;
}

// Returns whether the journal knows a file of this name as its own.
bool HasOwnName(const Journal& journal, const fs::path& name) {
  if (journal.done_names.contains(kFramesFolder / name.filename())) {
    return true;
  }
  const bool was_done = std::ranges::any_of(
      journal.done_names, [&](const fs::path& done) { return done.stem() == name.stem(); });
  return !was_done && journal.begun_names.contains(kFramesFolder / name.stem());
}

bool IsOwn(const Journal& journal, const fs::directory_entry& entry) {
  std::error_code ignored;
  const fs::path name = entry.path().filename();
  return entry.symlink_status(ignored).type() == fs::file_type::regular && IsRawName(name) &&
         HasOwnName(journal, name);
}

bool IsDone(const Journal& journal, const fs::directory_entry& entry) {
  const fs::path file = kFramesFolder / entry.path().filename();
  return std::ranges::any_of(journal.done,
                             [&](const auto& frame) { return frame && frame->file == file; });
}

}  // namespace

Status CheckNoLinks(const fs::path& dir) {
  for (const char* name : {kFramesFolder, kSavedRigFile, kJournalFile, kSessionFile}) {
    if (IsLink(dir / name)) {
      return Fail(ErrorCode::kInvalidArgument,
                  "{}: is a link, and a session holds its own files; put what it leads to in its "
                  "place, or choose another folder",
                  (dir / name).string());
    }
  }
  return {};
}

Status CheckFrameName(const fs::path& dir, const Journal& journal, std::size_t frame) {
  const fs::path name = FileNameOf(frame, journal.plan[frame], {});
  if (journal.begun_names.contains(name)) {
    return {};
  }
  for (const fs::directory_entry& entry : EntriesOf(dir)) {
    const fs::path file = entry.path().filename();
    if (IsRawName(file) && file.stem() == name.filename()) {
      return Fail(ErrorCode::kInvalidArgument,
                  "{}: is not of this capture and has the place of its frame {}; move it away",
                  entry.path().string(), frame + 1);
    }
  }
  return {};
}

Status CheckFrameFile(const fs::path& dir, const Journal& journal, const fs::path& file) {
  std::error_code ignored;
  const fs::file_type there = fs::symlink_status(dir / file, ignored).type();
  if (there != fs::file_type::not_found && there != fs::file_type::regular) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: is a link or a folder where a frame must go; move it away",
                (dir / file).string());
  }
  if (there == fs::file_type::regular && !HasOwnName(journal, file)) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: is not of this capture and has the place of one of its frames; move it away",
                (dir / file).string());
  }
  return {};
}

void RemoveFormerFrames(const fs::path& dir, const Journal& journal) {
  for (const fs::directory_entry& entry : EntriesOf(dir)) {
    if (IsOwn(journal, entry) && !IsDone(journal, entry)) {
      std::error_code ignored;  // then it is in nobody's way
      fs::remove(entry.path(), ignored);
    }
  }
}

void NameOtherFiles(const fs::path& dir, const Journal& journal) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : EntriesOf(dir)) {
    if (!IsOwn(journal, entry)) {
      names.push_back(entry.path().filename().string());
    }
  }
  if (names.empty()) {
    return;
  }
  const std::size_t named = std::min(names.size(), kMostNames);
  Notice(fmt::format(
      "{}: {} not of this capture and left alone: {}{}", (dir / kFramesFolder).string(),
      names.size() == 1 ? "one entry is" : fmt::format("{} entries are", names.size()),
      fmt::join(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(named), ", "),
      names.size() > named ? fmt::format(" and {} more", names.size() - named) : ""));
}

}  // namespace sateen
