#include "cli/scratch_folder.h"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace sateen::cli {
namespace {

constexpr double kBytesPerGb = 1e9;
constexpr double kBytesPerKib = 1024.0;

}  // namespace

ScratchFolder::ScratchFolder(std::string_view name)
    : path_(std::filesystem::temp_directory_path() / fmt::format("sateen-{}-{}", name, getpid())) {}

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

double PeakMemoryGb() {
  std::ifstream status("/proc/self/status");  // Linux
  for (std::string word; status >> word;) {
    double kib = 0.0;
    if (word == "VmHWM:" && status >> kib) {
      return kib * kBytesPerKib / kBytesPerGb;
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * kBytesPerKib / kBytesPerGb;
}

void ResetPeakMemory() { std::ofstream("/proc/self/clear_refs") << "5"; }

}  // namespace sateen::cli
