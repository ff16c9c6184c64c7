#include "core/files/output_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "core/check.h"
#include "core/files/file_exchange.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

fs::path ParentOf(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
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
                SystemReason(error_number), FolderAdvice(error_number));
  }
  return {};
}

// Fails where a former run's file could not be replaced as one: a folder, or what a link leads to.
Status CheckPlace(const fs::path& dir, const std::string& name) {
  fs::path place = dir;
  const fs::path relative(name);
  for (auto part = relative.begin(); part != relative.end(); ++part) {
    place /= *part;
    const bool is_file = std::next(part) == relative.end();
    std::error_code ignored;
    const fs::file_type type = fs::symlink_status(place, ignored).type();
    if (type == fs::file_type::not_found || (is_file && type == fs::file_type::regular) ||
        (!is_file && type == fs::file_type::directory)) {
      continue;
    }
    return Fail(ErrorCode::kIo, "{}: is {} where a {} must go; move it away", place.string(),
                type == fs::file_type::directory ? "a folder"
                : type == fs::file_type::symlink ? "a link"
                : type == fs::file_type::regular ? "a file"
                                                 : "a device or a pipe",
                is_file ? "file" : "folder");
  }
  return {};
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
  CleanUpAfterKills(dir);
  Result<OwnFolder> staging = OwnFolder::Make(dir, kStagingPrefix);
  if (!staging) {
    return tl::unexpected(staging.error());
  }
  folder.staging_.emplace(*std::move(staging));
  return folder;
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : dir_(std::move(other.dir_)),
      staging_(std::exchange(other.staging_, std::nullopt)),
      created_(std::exchange(other.created_, {})),
      names_(std::exchange(other.names_, {})),
      retired_(std::exchange(other.retired_, {})) {}

OutputFolder::~OutputFolder() { Discard(); }

fs::path OutputFolder::Stage(const std::string& name) {
  const fs::path relative(name);
  SATEEN_CHECK(staging_.has_value());
  SATEEN_CHECK(relative.has_filename() && relative.is_relative());
  SATEEN_CHECK(std::find(relative.begin(), relative.end(), "..") == relative.end());
  if (std::find(names_.begin(), names_.end(), name) == names_.end()) {
    names_.push_back(name);
  }
  std::error_code ignored;  // whoever writes the file will fail and say why
  fs::create_directories((staging_->Path() / relative).parent_path(), ignored);
  return staging_->Path() / relative;
}

Status OutputFolder::WriteText(const std::string& name, const std::string& text) {
  return WriteBytes(Stage(name), text, dir_ / name);
}

void OutputFolder::Retire(const std::string& name) { retired_.push_back(name); }

Error OutputFolder::InPlace(Error error) const {
  const std::string staged = staging_ ? staging_->Path().string() : "";
  for (size_t at = error.message.find(staged); !staged.empty() && at != std::string::npos;
       at = error.message.find(staged)) {
    error.message.replace(at, staged.size(), dir_.string());
  }
  return error;
}

Status OutputFolder::Commit() {
  SATEEN_CHECK(staging_.has_value());
  for (const std::string& name : retired_) {
    if (Status ready = CheckPlace(dir_, name); !ready) {
      return ready;
    }
  }
  for (const std::string& name : names_) {
    const fs::path place = dir_ / name;
    Status ready = CheckPlace(dir_, name)
                       .and_then([&] { return FlushToDisk(staging_->Path() / name, place); })
                       .and_then([&] { return MakeFolders(place.parent_path(), created_); });
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

  bool keeps_former = false;
  const FileExchange exchange = {staging_->Path(), dir_, names_, retired_};
  if (Status placed = exchange.Run(folders, keeps_former); !placed) {
    if (keeps_former) {
      staging_->Keep();
    }
    return placed;
  }
  created_.clear();
  Discard();
  return {};
}

void OutputFolder::Discard() noexcept {
  staging_.reset();
  std::error_code ignored;
  for (; !created_.empty(); created_.pop_back()) {
    fs::remove(created_.back(), ignored);  // only where it is empty
  }
}

Status WriteFileWhole(const fs::path& path, const std::string& text) {
  std::error_code ignored;
  // Through a symbolic link to the file that it stands for.
  const fs::path target =
      fs::is_symlink(path, ignored) ? fs::weakly_canonical(path, ignored) : path;
  const fs::file_status old = fs::status(target, ignored);
  if (target.empty()) {
    return Fail(ErrorCode::kIo, "{}: its links lead nowhere; give the name of a file",
                path.string());
  }
  if (fs::is_directory(old)) {
    return Fail(ErrorCode::kIo, "{}: is a folder; give the name of a file", path.string());
  }
  if (fs::exists(old) && !fs::is_regular_file(old)) {
    return Fail(ErrorCode::kIo, "{}: is a device or a pipe; give the name of a file",
                path.string());
  }
  CleanUpAfterKills(ParentOf(target));
  const Result<OwnFolder> staging = OwnFolder::Make(ParentOf(target), kStagingPrefix);
  if (!staging) {
    return tl::unexpected(staging.error());
  }
  const fs::path staged = staging->Path() / "file";
  Status status =
      WriteBytes(staged, text, path).and_then([&] { return FlushToDisk(staged, path); });
  if (!status) {
    return status;
  }
  if (fs::exists(old)) {
    fs::permissions(staged, old.permissions(), ignored);
  }
  if (rename(staged.c_str(), target.c_str()) != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot put in place: {}", path.string(), SystemReason(errno));
  }
  return FlushFolders({ParentOf(target)});
}

}  // namespace sateen
