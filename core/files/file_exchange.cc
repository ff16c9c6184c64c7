#include "core/files/file_exchange.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <optional>
#include <sstream>
#include <utility>

#include "core/files/file_io.h"
#include "core/files/own_folder.h"
#include "core/notice.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr const char* kList = ".exchange";
constexpr const char* kAside = ".replaced";
constexpr const char* kEnd = "end";  // last line of a list that was written whole

// Tells a file from any other by what a rename leaves as it is.
std::string Identity(const fs::path& path) {
  struct stat found {};
  if (lstat(path.c_str(), &found) != 0) {
    return "";
  }
  return fmt::format("{}:{}:{}.{}", found.st_ino, found.st_size, found.st_mtim.tv_sec,
                     found.st_mtim.tv_nsec);
}

bool IsThere(const fs::path& path) {
  std::error_code ignored;
  return fs::symlink_status(path, ignored).type() != fs::file_type::not_found;
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

// One line per new file: what it is, and its name.
Status WriteList(const FileExchange& exchange) {
  std::string text;
  for (const std::string& name : exchange.names) {
    text += Identity(exchange.staging / name) + " " + name + "\n";
  }
  const fs::path list = exchange.staging / kList;
  return WriteBytes(list, text + kEnd + "\n", list)
      .and_then([&] { return FlushToDisk(list, list); })
      .and_then([&] { return FlushFolders({exchange.staging}); });
}

struct Listed {
  std::string identity;
  std::string name;
};

// Nothing where no list was written whole, so that no file has moved, or where all have.
std::optional<std::vector<Listed>> ReadList(const fs::path& staging) {
  std::istringstream text(ReadFileBytes(staging / kList).value_or(""));
  std::vector<Listed> list;
  for (std::string line; std::getline(text, line);) {
    if (line == kEnd) {
      return list;
    }
    const size_t blank = line.find(' ');
    if (blank == std::string::npos) {
      return std::nullopt;
    }
    list.push_back({line.substr(0, blank), line.substr(blank + 1)});
  }
  return std::nullopt;
}

// Says that the exchange is complete, as one without a list is.
Status RemoveList(const fs::path& staging) {
  if (unlink((staging / kList).c_str()) != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot remove: {}", (staging / kList).string(),
                SystemReason(errno));
  }
  // Where this fails, a loss of power may bring the list back, and the next run the former files.
  (void)FlushFolders({staging});
  return {};
}

std::vector<fs::path> FilesBelow(const fs::path& dir) {
  std::vector<fs::path> files;
  std::error_code failed;
  for (fs::recursive_directory_iterator entry(dir, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    std::error_code ignored;
    if (!entry->is_directory(ignored) || entry->is_symlink(ignored)) {
      files.push_back(entry->path().lexically_relative(dir));  // of a link, not of its target
    }
  }
  return files;
}

Status MoveAll(const FileExchange& exchange, const std::vector<fs::path>& folders, Moves& moves) {
  const fs::path aside = exchange.staging / kAside;
  std::vector<std::string> old = exchange.retired;
  old.insert(old.end(), exchange.names.begin(), exchange.names.end());
  for (auto name = old.rbegin(); name != old.rend(); ++name) {
    if (!IsThere(exchange.dir / *name)) {
      continue;
    }
    std::error_code ignored;  // Move() will fail and say so
    fs::create_directories((aside / *name).parent_path(), ignored);
    if (Status moved = moves.Move(exchange.dir / *name, aside / *name, exchange.dir / *name);
        !moved) {
      return moved;
    }
  }
  for (const std::string& name : exchange.names) {
    Status moved;
    if (&name == &exchange.names.back()) {
      moved = FlushFolders(folders);
    }
    moved = moved.and_then([&] {
      return moves.Move(exchange.staging / name, exchange.dir / name, exchange.dir / name);
    });
    if (!moved) {
      return moved;
    }
  }
  return FlushFolders(folders);
}

}  // namespace

Status FileExchange::Run(const std::vector<fs::path>& folders, bool& keeps_former) const {
  keeps_former = false;
  if (Status listed = WriteList(*this); !listed) {
    return listed;
  }
  Moves moves;
  Status placed = MoveAll(*this, folders, moves).and_then([&] { return RemoveList(staging); });
  if (!placed && !moves.TakeBack()) {  // former files must not go with the staging folder
    keeps_former = true;
    placed.error().message += fmt::format(
        "; the files that were there are kept in {}, and the next run into this folder "
        "puts them back",
        staging.string());
  }
  return placed;
}

ExchangeUndone UndoExchange(const fs::path& staging, const fs::path& dir) {
  ExchangeUndone undone;
  const std::optional<std::vector<Listed>> list = ReadList(staging);
  if (!list) {
    return undone;
  }
  for (auto file = list->rbegin(); file != list->rend(); ++file) {
    if (!IsThere(staging / file->name) && Identity(dir / file->name) == file->identity) {
      [[maybe_unused]] const int ignored =  // then the former file is kept
          rename((dir / file->name).c_str(), (staging / file->name).c_str());
    }
  }
  for (const fs::path& name : FilesBelow(staging / kAside)) {
    const fs::path former = staging / kAside / name;
    if (!IsThere(dir / name) && rename(former.c_str(), (dir / name).c_str()) == 0) {
      ++undone.back;
    } else {
      undone.kept.push_back(former);
    }
  }
  return undone;
}

void CleanUpAfterKills(const fs::path& dir) {
  for (OwnFolder& left : OwnFolder::Abandoned(dir, kStagingPrefix, Notice)) {
    const ExchangeUndone undone = UndoExchange(left.Path(), dir);
    if (undone.back > 0) {
      Notice(
          fmt::format("{}: an earlier run was cut short while it put its files in place; the {} "
                      "files from before it are back",
                      dir.string(), undone.back));
    }
    for (const fs::path& kept : undone.kept) {
      Notice(
          fmt::format("{}: an earlier run was cut short while it put its files in place, and "
                      "another file has this file's place by now; move it where you need it, "
                      "then remove {}",
                      kept.string(), left.Path().string()));
    }
    if (!undone.kept.empty()) {
      left.Keep();
    }
  }
}

Status FlushFolders(const std::vector<fs::path>& folders) {
  for (const fs::path& folder : folders) {
    if (access(folder.c_str(), R_OK) != 0) {
      continue;
    }
    if (Status flushed = FlushToDisk(folder, folder); !flushed) {
      return flushed;
    }
  }
  return {};
}

}  // namespace sateen
