#pragma once

#include <optional>
#include <vector>

#include "core/error.h"
#include "rig/rig.h"
#include "scanner/checks/signal_levels.h"

namespace sateen {

struct ExposureGoal {
  // Target of the 99.9th percentile of the brightest light's frame, relative to saturation.
  // (0, 0.95]
  double peak = 0.8;
  // 10th percentile below which a longer exposure is added, relative to saturation: DarkestUseful()
  // of the rig's response. [0, 1)
  double low = 0.004;
  // Largest number of exposures per light; 1 to 3.
  int most = 3;
  // Longest exposure for which a light may be on. [s]
  double longest_s = 5.0;
};

// Returns the signal, relative to saturation, at which the sensor's noise is a tenth of it: from
// the response's gain g and read noise r, s = 50 g (1 + sqrt(1 + r^2 / (25 g^2))) in DN; 0.004
// without a response.
[[nodiscard]] double DarkestUseful(const std::optional<Response>& response);

/// Finds the exposure of a scene by test frames of its brightest light. A reading is proportional
/// to the exposure time, so a frame that is neither clipped nor nearly black gives the answer:
///
///     t = t_test goal.peak / peak_test, as the camera's next shorter time                     (1)
///
/// * A clipped frame is tried again at an eighth of its time.
/// * A frame below a tenth of full scale is tried again at the time that (1) gives, at most
///   sixteenfold and below what was clipped.
/// * Where the dark parts are below goal.low at t, longer exposures follow, each eight times the
///   one before, until they are not, `most` are reached, or the camera has no longer time.
///
/// Errors   kInvalidArgument: no times to choose from
///          kBadData, of Take(): too bright at the shortest time or nothing to see at the longest
class ExposureSearch {
 public:
  // times_s ascending: what the camera has.
  [[nodiscard]] static Result<ExposureSearch> Begin(std::vector<double> times_s,
                                                    const ExposureGoal& goal);

  // Returns the exposure time of the next test frame. [s]
  [[nodiscard]] double TestTime() const { return times_s_[test_]; }
  // Takes the levels of that frame; then Found() is true, or TestTime() is the next.
  [[nodiscard]] Status Take(const SignalLevels& levels);
  [[nodiscard]] bool Found() const { return !found_s_.empty(); }
  // Returns the exposures, the shortest first. [s]
  [[nodiscard]] const std::vector<double>& Exposures() const { return found_s_; }

 private:
  ExposureSearch(std::vector<double> times_s, const ExposureGoal& goal);

  // Returns the camera's longest time that is not above `time_s`, or its shortest.
  [[nodiscard]] size_t AtMost(double time_s) const;
  void AddBrackets(double low);

  std::vector<double> times_s_;
  ExposureGoal goal_;
  size_t test_ = 0;
  size_t clipped_ = 0;  // the shortest time that was; the times' count where none was
  std::vector<double> found_s_;
};

}  // namespace sateen
