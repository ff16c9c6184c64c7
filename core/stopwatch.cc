#include "core/stopwatch.h"

#include <chrono>

namespace sateen {
namespace {

int64_t NowNs() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

}  // namespace

Stopwatch::Stopwatch() : start_ns_(NowNs()) {}

double Stopwatch::Seconds() const { return 1e-9 * static_cast<double>(NowNs() - start_ns_); }

}  // namespace sateen
