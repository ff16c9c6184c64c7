#include "core/files/own_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <mutex>
#include <set>
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

enum class Left { kNothingOfOurs, kAlive, kAbandoned, kOfAnotherUser, kWithoutLocks };

// State of a folder that has such a name, as a later run finds it.
struct Found {
  Left left = Left::kNothingOfOurs;
  int mark = -1;  // descriptor, of a folder of this user
};

Found LookAtAnothers(const fs::path& folder, int dir) {
  struct stat found {};
  const bool may_have_mark =
      dir < 0 ? lstat(folder.c_str(), &found) == 0 && S_ISDIR(found.st_mode) &&
                    found.st_uid != geteuid()
              : fstatat(dir, kMark, &found, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(found.st_mode);
  return {.left = may_have_mark ? Left::kOfAnotherUser : Left::kNothingOfOurs};
}

// Opens the mark and tries to lock it. Follows no links. Removes the folder if this user made it
// and there is nothing in it.
Found LookAt(const fs::path& folder) {
  const int dir = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (dir < 0) {
    return errno == EACCES ? LookAtAnothers(folder, dir) : Found();
  }
  struct stat found {};
  if (fstat(dir, &found) != 0 || found.st_uid != geteuid()) {
    const Found anothers = LookAtAnothers(folder, dir);
    close(dir);
    return anothers;
  }
  int mark = openat(dir, kMark, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  close(dir);
  if (mark >= 0 && (fstat(mark, &found) != 0 || !S_ISREG(found.st_mode))) {
    close(std::exchange(mark, -1));
  }
  if (mark < 0) {
    rmdir(folder.c_str());  // only where it is empty
    return {};
  }
  const Lock lock = TryLock(mark);
  return {lock == Lock::kTaken         ? Left::kAbandoned
          : lock == Lock::kHeldByOther ? Left::kAlive
                                       : Left::kWithoutLocks,
          mark};
}

bool MayHoldFiles(const fs::path& folder) {
  std::error_code failed;
  fs::directory_iterator entry(folder, failed);
  for (const fs::directory_iterator end; !failed && entry != end; entry.increment(failed)) {
    if (entry->path().filename() != kMark) {
      return true;
    }
  }
  return static_cast<bool>(failed);
}

// Returns true the first time that it is asked about a folder: a program looks into the same place
// for every file that it writes there.
bool IsNews(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<fs::path> told;
  const std::lock_guard lock(mutex);
  return told.insert(folder).second;
}

void TellOfDoubt(const fs::path& folder, Left left, const NoticeSink& tell) {
  if ((left == Left::kOfAnotherUser || left == Left::kWithoutLocks) && MayHoldFiles(folder) &&
      IsNews(folder)) {
    tell(
        fmt::format("{}: a run left this folder or still works in it, which cannot be told, "
                    "because {}; if none works here, look into it for files that you miss, then "
                    "remove it",
                    folder.string(),
                    left == Left::kOfAnotherUser ? "it belongs to another user"
                                                 : "this disk has no file locks"));
  }
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

std::vector<OwnFolder> OwnFolder::Abandoned(const fs::path& parent, std::string_view prefix,
                                            const NoticeSink& tell) {
  std::vector<OwnFolder> abandoned;
  std::error_code ignored;  // what cannot be listed cannot be removed either
  for (fs::directory_iterator entry(parent, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    if (!HasOwnName(entry->path().filename().string(), prefix)) {
      continue;
    }
    const Found found = LookAt(entry->path());
    if (found.left == Left::kAbandoned) {
      abandoned.push_back(OwnFolder(entry->path(), found.mark));
      continue;
    }
    if (found.mark >= 0) {
      close(found.mark);
    }
    if (tell) {
      TellOfDoubt(entry->path(), found.left, tell);
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
