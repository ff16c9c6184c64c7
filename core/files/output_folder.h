#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/files/file_io.h"
#include "core/files/own_folder.h"

namespace sateen {

/// A set of files that appears in a folder whole, or not at all.
///
/// Files are written under the names that Stage() gives, in a hidden folder beside their place.
/// Commit() flushes them to the disk and renames each to its place, in the order staged, so the
/// last one (the record) is there only when all others are; an old record goes first. Without
/// Commit(), or when it fails, everything written is removed, old files are as they were, and the
/// folder is removed if Open() made it. What a killed run left hidden in the folder is removed by
/// the next Open(). If it was killed within Commit(), its former files are put back, and a notice
/// says so.
class OutputFolder {
 public:
  // Creates `dir` where it is missing. kIo where it cannot be created or written to.
  [[nodiscard]] static Result<OutputFolder> Open(const std::filesystem::path& dir);

  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  ~OutputFolder();

  // Returns where to write the file that will be `name` ("normal.exr", "truth/normal.exr").
  [[nodiscard]] std::filesystem::path Stage(const std::string& name);
  // Stages `name` with `text` as its content.
  [[nodiscard]] Status WriteText(const std::string& name, const std::string& text);
  // Makes Commit() take away the file `name` of an earlier run, unless it is staged. A link or a
  // folder there makes it fail.
  void Retire(const std::string& name);
  // Returns the error of whoever wrote to a staged place, speaking of the place that the user
  // knows.
  [[nodiscard]] Error InPlace(Error error) const;
  // Fails with kIo, which names the file that could not be flushed or put in place, or the link or
  // folder that has its place.
  [[nodiscard]] Status Commit();

  [[nodiscard]] const std::filesystem::path& Dir() const { return dir_; }

 private:
  OutputFolder() = default;
  void Discard() noexcept;

  std::filesystem::path dir_;
  std::optional<OwnFolder> staging_;            // absent once committed, discarded or moved from
  std::vector<std::filesystem::path> created_;  // folders made by Open(), outermost first
  std::vector<std::string> names_;
  std::vector<std::string> retired_;
};

// Replaces one file whole or not at all, keeping its permissions; its folder must exist. Where
// `path` is a link, the file that it leads to is replaced. kIo: it is no regular file.
[[nodiscard]] Status WriteFileWhole(const std::filesystem::path& path, const std::string& text);

}  // namespace sateen
