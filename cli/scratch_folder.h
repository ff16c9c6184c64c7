#pragma once

#include <filesystem>

#include "core/error.h"

namespace sateen::cli {

// A folder of its own under $TMPDIR, or /tmp, removed with all in it.
class ScratchFolder {
 public:
  explicit ScratchFolder(std::string_view name);
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder();

  // kIo where it cannot be made.
  [[nodiscard]] Status Create() const;
  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// Most memory that the process has held since ResetPeakMemory(), or, where the system cannot do
// that, since it began.
[[nodiscard]] double PeakMemoryGb();
void ResetPeakMemory();

}  // namespace sateen::cli
