#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <vector>

#include "core/error.h"

namespace sateen {

/// What the lights of the board have done by the wall clock, for who asks later how bright they
/// were while a shutter was open. One thread writes, any may ask. Of a light that is told the level
/// u(t), the output r(t) follows with the time constant tau:
///
///     dr/dt = (u - r) / tau,   r = u once 16 tau have passed since u last changed            (1)
///     mean of r over [b, e] = (integral of u - tau (r(e) - r(b))) / (e - b)                  (2)
///
/// so that the mean is exactly the level where a light is on long before and until after. What is
/// more than half an hour old is forgotten.
class LightLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;

  // All lights are off. `rise`: tau of (1), not negative.
  explicit LightLog(int lights, std::chrono::nanoseconds rise = {});

  // From `when` on the light is told `level`. In the order of time.
  void Changed(Time when, int light, double level);
  // All that has happened before `when` has been told.
  void KnownUntil(Time when);
  // Nothing more will be told, and nobody waits for it any longer.
  void Close();

  // (2) for each light; the output at `begin` where `end` is not later. Waits until all is known.
  // kTimeout: it is not within `longest`; kCancelled: closed.
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
    double integral_s = 0.0;  // of u over [begin, end]
  };
  [[nodiscard]] Output OutputOf(const std::deque<Change>& changes, Time begin, Time end) const;

  const double rise_s_;
  mutable std::mutex mutex_;  // guards all below
  mutable std::condition_variable told_;
  std::vector<std::deque<Change>> changes_;  // of each light; the first is what it began with
  Time known_until_ = Time::min();
  bool closed_ = false;
};

}  // namespace sateen
