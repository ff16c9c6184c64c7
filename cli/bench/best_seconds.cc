#include "cli/bench/best_seconds.h"

#include <algorithm>
#include <chrono>
#include <limits>

namespace sateen::cli {

Result<double> BestSeconds(int repeats, const std::function<Status()>& run) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    if (Status status = run(); !status) {
      return tl::unexpected(status.error());
    }
    best = std::min(
        best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

}  // namespace sateen::cli
