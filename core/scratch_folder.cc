#include "core/scratch_folder.h"

#include <unistd.h>

#include <atomic>

namespace sateen {
namespace {

std::atomic<int> scratch_count = 0;  // in this process

}  // namespace

ScratchFolder::ScratchFolder(std::string_view name)
    : path_(std::filesystem::temp_directory_path() /
            fmt::format("sateen-{}-{}-{}", name, getpid(), scratch_count++)) {}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

Status ScratchFolder::Create() const {
  std::error_code error;
  std::filesystem::create_directory(path_, error);
  return error ? Status(Fail(ErrorCode::kIo, "{}: cannot be created: {}; set TMPDIR",
                             path_.string(), error.message()))
               : Status();
}

}  // namespace sateen
