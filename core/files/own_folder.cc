#include "core/files/own_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <optional>
#include <string>
#include <utility>

#include "core/files/file_io.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".sateen-own";
constexpr size_t kRandomLetters = 6;

enum class Lock { kTaken, kHeldByOther, kUnknown };

Lock TryLock(int mark) {
  if (flock(mark, LOCK_EX | LOCK_NB) != 0) {
    return errno == EWOULDBLOCK ? Lock::kHeldByOther : Lock::kUnknown;
  }
  struct stat found {};  // whoever held it may have removed the folder
  return fstat(mark, &found) == 0 && found.st_nlink > 0 ? Lock::kTaken : Lock::kHeldByOther;
}

bool HasOwnName(const std::string& name, std::string_view prefix) {
  return name.size() == prefix.size() + kRandomLetters && name.starts_with(prefix) &&
         std::all_of(name.end() - kRandomLetters, name.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0; });
}

// Opens the mark of a folder that this user made; -1 where there is none. Follows no links.
int OpenMark(const fs::path& folder) {
  struct stat found {};
  const int dir = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (dir < 0) {
    return -1;
  }
  const bool is_ours = fstat(dir, &found) == 0 && found.st_uid == geteuid();
  int mark = is_ours ? openat(dir, kMark, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC) : -1;
  if (mark >= 0 && (fstat(mark, &found) != 0 || !S_ISREG(found.st_mode))) {
    close(std::exchange(mark, -1));
  }
  if (is_ours && mark < 0) {
    rmdir(folder.c_str());  // only where it is empty
  }
  close(dir);
  return mark;
}

}  // namespace

Result<OwnFolder> OwnFolder::Make(const fs::path& parent, std::string_view prefix) {
  int error_number = 0;
  while (true) {
    std::string name = (parent / prefix).string() + std::string(kRandomLetters, 'X');
    if (mkdtemp(name.data()) == nullptr) {
      error_number = errno;
      break;
    }
    const int mark = open((fs::path(name) / kMark).c_str(),
                          O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (mark >= 0 && TryLock(mark) != Lock::kHeldByOther) {
      return OwnFolder(name, mark);
    }
    // Another run may have come between, and taken it for abandoned.
    error_number = mark >= 0 ? ENOENT : errno;
    if (mark >= 0) {
      close(mark);
    }
    if (error_number != ENOENT) {
      rmdir(name.c_str());
      break;
    }
  }
  return Fail(ErrorCode::kIo, "{}: cannot write to this folder: {}{}", parent.string(),
              SystemReason(error_number), FolderAdvice(error_number));
}

std::vector<OwnFolder> OwnFolder::Abandoned(const fs::path& parent, std::string_view prefix) {
  std::vector<OwnFolder> abandoned;
  std::error_code ignored;  // what cannot be listed cannot be removed either
  for (fs::directory_iterator entry(parent, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    if (!HasOwnName(entry->path().filename().string(), prefix)) {
      continue;
    }
    const int mark = OpenMark(entry->path());
    if (mark >= 0 && TryLock(mark) == Lock::kTaken) {
      abandoned.push_back(OwnFolder(entry->path(), mark));
    } else if (mark >= 0) {
      close(mark);
    }
  }
  return abandoned;
}

OwnFolder::OwnFolder(OwnFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})), lock_(std::exchange(other.lock_, -1)) {}

OwnFolder::~OwnFolder() {
  if (!path_.empty()) {
    std::error_code failed;
    std::vector<fs::path> content;
    for (fs::directory_iterator entry(path_, failed), end; !failed && entry != end;
         entry.increment(failed)) {
      if (entry->path().filename() != kMark) {
        content.push_back(entry->path());
      }
    }
    for (const fs::path& path : content) {
      std::error_code ignored;
      fs::remove_all(path, ignored);
      failed = failed ? failed : ignored;
    }
    if (!failed) {
      // A network disk keeps the name of a file, or another one for it, until it is closed.
      unlink((path_ / kMark).c_str());
      close(std::exchange(lock_, -1));
      rmdir(path_.c_str());
    }
  }
  if (lock_ >= 0) {
    close(lock_);
  }
}

void OwnFolder::Keep() { path_.clear(); }

Result<OwnFolder> MakeScratchFolder(std::string_view name) {
  std::error_code error;
  const fs::path parent = fs::temp_directory_path(error);
  if (error) {
    return Fail(ErrorCode::kIo, "the folder for temporary files: {}; set TMPDIR to a folder",
                error.message());
  }
  const std::string prefix = fmt::format("sateen-{}-", name);
  OwnFolder::Abandoned(parent, prefix).clear();
  return OwnFolder::Make(parent, prefix).map_error([](Error failure) {
    failure.message += ", with TMPDIR";
    return failure;
  });
}

}  // namespace sateen
