#pragma once

#include <filesystem>
#include <string_view>

#include "core/error.h"

namespace sateen {

// A folder of its own under $TMPDIR, or /tmp, removed with all in it.
class ScratchFolder {
 public:
  explicit ScratchFolder(std::string_view name);
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder();

  // Fails with kIo if it cannot be made.
  [[nodiscard]] Status Create() const;
  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace sateen
