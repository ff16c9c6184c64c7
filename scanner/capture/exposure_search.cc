#include "scanner/capture/exposure_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sateen {
namespace {

constexpr double kFirstTest_s = 1.0 / 50.0;
constexpr double kClipped = 0.98;     // a peak from here on tells nothing but that it is too bright
constexpr double kTells = 0.1;        // a peak from here on gives the answer
constexpr double kNothing = 0.002;    // a peak below is nothing that light could have made
constexpr double kShorter = 8.0;      // factor for the next test after a clipped one
constexpr double kLonger = 16.0;      // factor for the next test after a dark one, at most
constexpr double kBracketStep = 8.0;  // between exposures of a light
constexpr double kRounding = 1.02;    // between a time's name and what (1) gives
constexpr double kWithoutResponse = 0.004;

}  // namespace

double DarkestUseful(const std::optional<Response>& response) {
  if (!response || !response->gain_dn_per_electron || !response->read_noise_dn) {
    return kWithoutResponse;
  }
  // s = 10 sqrt(g s + r^2)
  const double g = *response->gain_dn_per_electron;
  const double r = *response->read_noise_dn;
  const double s = 50.0 * g * (1.0 + std::sqrt(1.0 + r * r / (25.0 * g * g)));
  return std::min(0.5, s / (response->white - response->black));
}

Result<ExposureSearch> ExposureSearch::Begin(std::vector<double> times_s,
                                             const ExposureGoal& goal) {
  if (times_s.empty()) {
    return Fail(ErrorCode::kInvalidArgument,
                "the camera does not list its exposure times, so none can be found; give one, as "
                "--exposure 1/50");
  }
  return ExposureSearch(std::move(times_s), goal);
}

ExposureSearch::ExposureSearch(std::vector<double> times_s, const ExposureGoal& goal)
    : times_s_(std::move(times_s)), goal_(goal) {
  const double shortest = times_s_.front();
  std::erase_if(times_s_, [&](double time_s) { return time_s > goal.longest_s; });
  if (times_s_.empty()) {
    times_s_.push_back(shortest);
  }
  test_ = AtMost(kFirstTest_s);
  clipped_ = times_s_.size();
}

size_t ExposureSearch::AtMost(double time_s) const {
  const auto above = std::ranges::upper_bound(times_s_, time_s * kRounding);
  return above == times_s_.begin() ? 0 : static_cast<size_t>(above - times_s_.begin()) - 1;
}

Status ExposureSearch::Take(const SignalLevels& levels) {
  const double tested = TestTime();
  if (levels.peak >= kClipped) {
    if (test_ == 0) {
      return Fail(ErrorCode::kBadData,
                  "too bright even at the camera's shortest exposure of {:.4g} s: stop the lens "
                  "down, lower the ISO, or dim the lights with --level",
                  tested);
    }
    clipped_ = std::min(clipped_, test_);
    test_ = std::min(test_ - 1, AtMost(tested / kShorter));
    return {};
  }
  const double wanted = tested * goal_.peak / std::max(levels.peak, 1e-6);  // (1)
  if (levels.peak < kTells && test_ + 1 < clipped_) {
    test_ = std::clamp(AtMost(std::min(wanted, kLonger * tested)), test_ + 1, clipped_ - 1);
    return {};
  }
  if (levels.peak < kNothing) {
    return Fail(ErrorCode::kBadData,
                "the picture is black even at the longest exposure of {:.4g} s: is the lens cap "
                "off, do the lights have power, is the fabric in the picture?",
                tested);
  }
  const double base = times_s_[std::min(AtMost(wanted), clipped_ - 1)];
  found_s_.push_back(base);
  AddBrackets(levels.low * base / tested);
  return {};
}

void ExposureSearch::AddBrackets(double low) {
  while (low < goal_.low && static_cast<int>(found_s_.size()) < goal_.most) {
    const double next = times_s_[AtMost(found_s_.back() * kBracketStep)];
    if (next <= found_s_.back() * 2.0) {
      return;  // no time left that would be worth it
    }
    low *= next / found_s_.back();
    found_s_.push_back(next);
  }
}

}  // namespace sateen
