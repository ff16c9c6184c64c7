#include "cli/bench/peak_memory.h"

#include <sys/resource.h>

#include <fstream>
#include <string>

namespace sateen::cli {
namespace {

constexpr double kBytesPerGb = 1e9;
constexpr double kBytesPerKib = 1024.0;

}  // namespace

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
