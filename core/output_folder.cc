#include "core/output_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "core/check.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

fs::path ParentOf(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

Status FlushFolders(const std::vector<fs::path>& folders) {
  for (const fs::path& folder : folders) {
    // A folder may be written to and yet not be read; then it cannot be flushed either.
    if (access(folder.c_str(), R_OK) != 0) {
      continue;
    }
    if (Status flushed = FlushToDisk(folder, folder); !flushed) {
      return flushed;
    }
  }
  return {};
}

std::string Advice(int error_number) {
  switch (error_number) {
    case EACCES:
    case EPERM:
      return "; get write permission or choose another folder";
    case EROFS:
      return "; choose a folder on a disk that can be written to";
    case ENOSPC:
    case EDQUOT:
      return "; free some space or choose another disk";
    case ENOENT:
      return "; create the folder first";
    default:
      return "; choose another folder";
  }
}

// Makes a new, empty, hidden folder in `dir`, so on the same file system.
Result<fs::path> MakeStagingDir(const fs::path& dir) {
  std::string name = (dir / ".sateen-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    const int error_number = errno;
    return Fail(ErrorCode::kIo, "{}: cannot write to this folder: {}{}", dir.string(),
                SystemReason(error_number), Advice(error_number));
  }
  return fs::path(name);
}

// Makes the missing folders on the way to `dir` and appends them to `created`.
Status MakeFolders(const fs::path& dir, std::vector<fs::path>& created) {
  fs::path folder;
  for (const fs::path& part : dir) {
    folder /= part;
    std::error_code ignored;
    if (part.empty() || fs::is_directory(folder, ignored)) {
      continue;
    }
    if (mkdir(folder.c_str(), 0777) == 0) {
      created.push_back(folder);
      continue;
    }
    const int error_number = errno;
    if (error_number == EEXIST || error_number == ENOTDIR) {
      return Fail(ErrorCode::kIo, "{}: exists and is not a folder; give the name of a folder",
                  folder.string());
    }
    return Fail(ErrorCode::kIo, "{}: cannot create or enter this folder: {}{}", folder.string(),
                SystemReason(error_number), Advice(error_number));
  }
  return {};
}

// Renames that can be taken back as long as none of them is final.
class Moves {
 public:
  Status Move(const fs::path& from, const fs::path& to, const fs::path& shown) {
    if (rename(from.c_str(), to.c_str()) != 0) {
      return Fail(ErrorCode::kIo, "{}: cannot put in place: {}", shown.string(),
                  SystemReason(errno));
    }
    done_.emplace_back(from, to);
    return {};
  }
  [[nodiscard]] bool TakeBack() {
    bool all = true;
    for (; !done_.empty(); done_.pop_back()) {
      all &= rename(done_.back().second.c_str(), done_.back().first.c_str()) == 0;
    }
    return all;
  }

 private:
  std::vector<std::pair<fs::path, fs::path>> done_;
};

// Moves old files to `aside`, the last name (the record) first; then the new ones in, the record
// last, so that at no moment it stands beside files that it does not describe.
Status PutInPlace(const fs::path& from, const fs::path& to, const std::vector<std::string>& names,
                  const std::vector<std::string>& retired, const std::vector<fs::path>& folders,
                  Moves& moves) {
  const fs::path aside = from / ".replaced";
  std::vector<std::string> old = retired;
  old.insert(old.end(), names.begin(), names.end());
  for (auto name = old.rbegin(); name != old.rend(); ++name) {
    std::error_code ignored;  // Move() will fail and say so
    if (fs::symlink_status(to / *name, ignored).type() == fs::file_type::not_found) {
      continue;
    }
    fs::create_directories((aside / *name).parent_path(), ignored);
    if (Status moved = moves.Move(to / *name, aside / *name, to / *name); !moved) {
      return moved;
    }
  }
  for (const std::string& name : names) {
    Status moved;
    if (&name == &names.back()) {
      moved = FlushFolders(folders);
    }
    moved = moved.and_then([&] { return moves.Move(from / name, to / name, to / name); });
    if (!moved) {
      return moved;
    }
  }
  return FlushFolders(folders);
}

}  // namespace

Result<OutputFolder> OutputFolder::Open(const fs::path& dir) {
  if (dir.empty()) {
    return Fail(ErrorCode::kIo, "the output folder has an empty name; give the name of a folder");
  }
  OutputFolder folder;  // its destructor removes what was made if a later step fails
  folder.dir_ = dir;
  if (Status made = MakeFolders(dir, folder.created_); !made) {
    return tl::unexpected(made.error());
  }
  Result<fs::path> staging_dir = MakeStagingDir(dir);
  if (!staging_dir) {
    return tl::unexpected(staging_dir.error());
  }
  folder.staging_dir_ = *std::move(staging_dir);
  return folder;
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : dir_(std::move(other.dir_)),
      staging_dir_(std::exchange(other.staging_dir_, {})),
      created_(std::exchange(other.created_, {})),
      names_(std::exchange(other.names_, {})),
      retired_(std::exchange(other.retired_, {})) {}

OutputFolder::~OutputFolder() { Discard(); }

fs::path OutputFolder::Stage(const std::string& name) {
  const fs::path relative(name);
  SATEEN_CHECK(!staging_dir_.empty());
  SATEEN_CHECK(relative.has_filename() && relative.is_relative());
  SATEEN_CHECK(std::find(relative.begin(), relative.end(), "..") == relative.end());
  if (std::find(names_.begin(), names_.end(), name) == names_.end()) {
    names_.push_back(name);
  }
  std::error_code ignored;  // whoever writes the file will fail and say why
  fs::create_directories((staging_dir_ / relative).parent_path(), ignored);
  return staging_dir_ / relative;
}

Status OutputFolder::WriteText(const std::string& name, const std::string& text) {
  return WriteBytes(Stage(name), text, dir_ / name);
}

void OutputFolder::Retire(const std::string& name) { retired_.push_back(name); }

Error OutputFolder::InPlace(Error error) const {
  const std::string staged = staging_dir_.string();
  for (size_t at = error.message.find(staged); !staged.empty() && at != std::string::npos;
       at = error.message.find(staged)) {
    error.message.replace(at, staged.size(), dir_.string());
  }
  return error;
}

Status OutputFolder::Commit() {
  SATEEN_CHECK(!staging_dir_.empty());
  for (const std::string& name : names_) {
    const fs::path place = dir_ / name;
    std::error_code ignored;
    if (fs::is_directory(fs::symlink_status(place, ignored))) {
      return Fail(ErrorCode::kIo, "{}: is a folder where a file must go; move it away",
                  place.string());
    }
    Status ready = FlushToDisk(staging_dir_ / name, place).and_then([&] {
      return MakeFolders(place.parent_path(), created_);
    });
    if (!ready) {
      return ready;
    }
  }
  std::vector<fs::path> folders;  // every folder that gets a new entry
  for (const fs::path& folder : created_) {
    folders.push_back(ParentOf(folder));
  }
  for (const std::string& name : names_) {
    folders.push_back(ParentOf(dir_ / name));
  }
  std::sort(folders.begin(), folders.end());
  folders.erase(std::unique(folders.begin(), folders.end()), folders.end());

  Moves moves;
  if (Status placed = PutInPlace(staging_dir_, dir_, names_, retired_, folders, moves); !placed) {
    if (!moves.TakeBack()) {  // earlier files must not go with the staging folder
      placed.error().message += fmt::format("; the files that were there are kept in {}",
                                            std::exchange(staging_dir_, {}).string());
    }
    return placed;
  }
  created_.clear();
  Discard();
  return {};
}

void OutputFolder::Discard() noexcept {
  std::error_code ignored;
  if (!staging_dir_.empty()) {
    fs::remove_all(std::exchange(staging_dir_, {}), ignored);
  }
  for (; !created_.empty(); created_.pop_back()) {
    fs::remove(created_.back(), ignored);  // only where it is empty
  }
}

Status WriteFileWhole(const fs::path& path, const std::string& text) {
  std::error_code ignored;
  // Through a symbolic link to the file that it stands for.
  const fs::path target =
      fs::is_symlink(path, ignored) ? fs::weakly_canonical(path, ignored) : path;
  if (target.empty() || fs::is_directory(target, ignored)) {
    return Fail(ErrorCode::kIo, "{}: is a folder; give the name of a file", path.string());
  }
  const Result<fs::path> staging_dir = MakeStagingDir(ParentOf(target));
  if (!staging_dir) {
    return tl::unexpected(staging_dir.error());
  }
  const fs::path staged = *staging_dir / "file";
  Status status =
      WriteBytes(staged, text, path).and_then([&] { return FlushToDisk(staged, path); });
  if (status) {
    if (const fs::file_status old = fs::status(target, ignored); fs::exists(old)) {
      fs::permissions(staged, old.permissions(), ignored);
    }
    status = Moves().Move(staged, target, path).and_then([&] {
      return FlushFolders({ParentOf(target)});
    });
  }
  fs::remove_all(*staging_dir, ignored);
  return status;
}

}  // namespace sateen
