#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/notice.h"

namespace sateen {

/// A folder with a name that nothing else has, removed with all in it at the end of its life.
///
/// Its first entry is a mark, `.sateen-own`: a file that stays locked as long as the process lives.
/// A later run knows by it what it may remove: a folder of the same user, with a mark that nobody
/// holds. It is removed last, so a removal that is killed is resumed. A folder that has such a name
/// and no mark is left alone, unless it is empty: a process was killed before the mark.
///
///     process alive            locked, never touched by others
///     process killed           Abandoned() gives it to the next run, which removes it
///     no locks on this disk    never touched by others, but named
///     of another user          never touched by others, but named
class OwnFolder {
 public:
  // Makes it in `parent`, as `prefix` and six letters or digits. kIo where it cannot be made.
  [[nodiscard]] static Result<OwnFolder> Make(const std::filesystem::path& parent,
                                              std::string_view prefix);
  // Returns those in `parent` whose process has ended. Removes those that are still empty. `tell`
  // hears once of each that may hold files and that nobody can know to be abandoned.
  [[nodiscard]] static std::vector<OwnFolder> Abandoned(const std::filesystem::path& parent,
                                                        std::string_view prefix,
                                                        const NoticeSink& tell = {});

  OwnFolder(OwnFolder&& other) noexcept;
  OwnFolder& operator=(OwnFolder&&) = delete;
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
  ~OwnFolder();

  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }
  // Leaves the folder where it is.
  void Keep();

 private:
  OwnFolder(std::filesystem::path path, int lock) : path_(std::move(path)), lock_(lock) {}

  std::filesystem::path path_;  // empty once moved from
  int lock_;                    // descriptor of the mark
};

// Makes a folder under $TMPDIR, or /tmp, and removes those of its name that killed processes left.
[[nodiscard]] Result<OwnFolder> MakeScratchFolder(std::string_view name);

}  // namespace sateen
