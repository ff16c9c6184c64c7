#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <vector>

#include "core/error.h"

namespace sateen {

/// Log of what the lights of the board did by the wall clock. It answers how bright they were while
/// a shutter was open. One thread writes, any may ask. When a light is told the level u(t), its
/// output r(t) follows with the time constant tau:
///
///     dr/dt = (u - r) / tau,   r = u once 16 tau have passed since u last changed            (1)
///     mean of r over [b, e] = (integral of u - tau (r(e) - r(b))) / (e - b)                  (2)
///
/// so that the mean is exactly the level where a light is on long before and until after. Changes
/// more than half an hour old are forgotten.
class LightLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;

  // Starts with all lights off. `rise`: tau of (1), not negative.
  explicit LightLog(int lights, std::chrono::nanoseconds rise = {});

  // Records that the light is told `level` from `when` on. Call it in the order of time.
  void Changed(Time when, int light, double level);
  // Declares that all that happened before `when` has been told.
  void KnownUntil(Time when);
  // Ends the log: nothing more will be told, and nobody waits for it any longer.
  void Close();

  // Returns (2) for each light; the output at `begin` where `end` is not later. Waits until all is
  // known. kTimeout: it is not within `longest`; kCancelled: closed.
  [[nodiscard]] Result<std::vector<double>> MeanLevels(
      Time begin, Time end, std::chrono::milliseconds longest = std::chrono::seconds(10)) const;

 private:
  struct Change {
    Time when;
    double level = 0.0;  // from then on
  };
  struct Output {
    double at_begin = 0.0;
    double at_end = 0.0;
    double integral_s = 0.0;  // integral of u over [begin, end]
  };
  [[nodiscard]] Output OutputOf(const std::deque<Change>& changes, Time begin, Time end) const;

  const double rise_s_;
  mutable std::mutex mutex_;  // guards all below
  mutable std::condition_variable told_;
  std::vector<std::deque<Change>> changes_;  // one list per light; the first is what it began with
  Time known_until_ = Time::min();
  bool closed_ = false;
};

}  // namespace sateen
