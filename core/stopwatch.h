#pragma once

#include <cstdint>

namespace sateen {

// Measures wall-clock time from when it is made, by the monotonic clock.
class Stopwatch {
 public:
  Stopwatch();

  // Returns the seconds since then.
  [[nodiscard]] double Seconds() const;

 private:
  int64_t start_ns_;  // not a time_point: <chrono> takes most files longer to parse than the rest
};

}  // namespace sateen
