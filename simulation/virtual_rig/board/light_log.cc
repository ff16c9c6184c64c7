#include "simulation/virtual_rig/board/light_log.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace sateen {
namespace {

constexpr std::chrono::minutes kRemembered(30);
constexpr double kSettledAfter = 16.0;  // times tau; e^-16 is less than a float can tell from 0

double Seconds(LightLog::Clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

LightLog::LightLog(int lights, std::chrono::nanoseconds rise)
    : rise_s_(Seconds(rise)), changes_(static_cast<size_t>(lights), {{.when = Time::min()}}) {
  SATEEN_CHECK(rise_s_ >= 0.0);
}

void LightLog::Changed(Time when, int light, double level) {
  const std::lock_guard lock(mutex_);
  std::deque<Change>& changes = changes_.at(static_cast<size_t>(light));
  changes.push_back({when, level});
  while (changes.size() > 1 && changes[1].when < when - kRemembered) {
    changes.pop_front();
  }
}

void LightLog::KnownUntil(Time when) {
  {
    const std::lock_guard lock(mutex_);
    known_until_ = when;
  }
  told_.notify_all();
}

void LightLog::Close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  told_.notify_all();
}

Result<std::vector<double>> LightLog::MeanLevels(Time begin, Time end,
                                                 std::chrono::milliseconds longest) const {
  std::unique_lock lock(mutex_);
  const bool known = told_.wait_for(lock, longest, [&] { return closed_ || known_until_ >= end; });
  if (!known) {
    return Fail(ErrorCode::kTimeout,
                "the board was not simulated up to the end of an exposure within {} ms; the "
                "machine is too busy for real time",
                longest.count());
  }
  if (known_until_ < end) {
    return Fail(ErrorCode::kCancelled, "the virtual rig ended during an exposure");
  }
  std::vector<double> means;
  means.reserve(changes_.size());
  for (const std::deque<Change>& changes : changes_) {
    const Output output = OutputOf(changes, begin, end);
    const double rest_s = rise_s_ * (output.at_end - output.at_begin);
    means.push_back(end > begin ? (output.integral_s - rest_s) / Seconds(end - begin)  // (2)
                                : output.at_begin);
  }
  return means;
}

LightLog::Output LightLog::OutputOf(const std::deque<Change>& changes, Time begin, Time end) const {
  Output output;
  double r = changes.front().level;  // at the change that the loop is at
  for (size_t i = 0; i < changes.size(); ++i) {
    const Change& change = changes[i];
    const bool last = i + 1 == changes.size();
    const auto output_at = [&](Time when) {
      if (i == 0 && when > change.when) {
        return change.level;  // since ever, or since longer than is remembered
      }
      const double taus = rise_s_ > 0.0 ? Seconds(when - change.when) / rise_s_ : kSettledAfter;
      return taus >= kSettledAfter ? change.level
                                   : change.level + (r - change.level) * std::exp(-taus);  // (1)
    };
    const auto holds_at = [&](Time when) {
      return when >= change.when && (last || when < changes[i + 1].when);
    };
    output.at_begin = holds_at(begin) ? output_at(begin) : output.at_begin;
    output.at_end = holds_at(end) ? output_at(end) : output.at_end;
    const Time from = std::max(begin, change.when);
    const Time until = last ? end : std::min(end, changes[i + 1].when);
    if (until > from) {
      output.integral_s += change.level * Seconds(until - from);
    }
    if (!last) {
      r = output_at(changes[i + 1].when);
    }
  }
  return output;
}

}  // namespace sateen
