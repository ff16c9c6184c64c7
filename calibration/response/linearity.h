#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calibration/response/chart_readings.h"
#include "calibration/response/linear_range.h"
#include "core/error.h"

namespace sateen {

inline constexpr double kFineTolerance = 0.002;

struct LinearityOptions {
  double tolerance = 0.01;  // largest deviation from proportionality to exposure; (0, 0.2]

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Sample, and the level that its exposure time predicts. [DN above the dark]
struct LinearityPoint {
  size_t colour = 0;
  double expected_dn = 0.0;
  double measured_dn = 0.0;
  bool is_clipped = false;  // true: some of its sites are saturated
};

// Linearity of one colour. Levels are DN as read.
struct ChannelLinearity {
  std::vector<LinearityBin> bins;       // bins of points that are not clipped, from dark to bright
  std::optional<double> saturation_dn;  // lowest saturated reading; nothing: no patch was saturated
  // Range in which readings are proportional to within the tolerance.
  double linear_from_dn = 0.0;
  double linear_to_dn = 0.0;
  bool departs = false;  // true: the tolerance is left at linear_to_dn; false: not known further
  // Level up to which readings are proportional to within kFineTolerance, which the exposure of
  // sheets needs. Nothing: readings do not tell.
  std::optional<double> fine_to_dn;
};

// Brightness per exposure time of a frame over that of its light's other frames.
struct FrameBrightness {
  size_t frame = 0;
  double ratio = 1.0;
};

struct Linearity {
  std::array<ChannelLinearity, 3> rgb;
  std::vector<LinearityPoint> points;
  std::vector<FrameBrightness> frames;  // those with something between dark and half of white
};

/// Measures how proportional readings are to exposure time. Each series p, of one light, patch and
/// colour, has a slope of its own, so that it does not matter how the light falls on the chart:
///
///     s = a_p t,      a_p by least squares over signals of 3 to 50 % of the range            (1)
///     deviation = s / (a_p t) - 1                                                           (2)
///
/// Deviations of all patches and of all lights with at least three exposure times are averaged in
/// bins of 3 %. The range is that of FindLinearRange() from the lowest level of (1). A wrong
/// exposure time or a flickering light shows in all patches of its frame: their median deviation is
/// added to the frame's noise, so that one such frame does not end the range.
///
/// Patches that should read a tenth more than any patch does are saturated. The saturation level is
/// the median of their sites less three robust standard deviations.
///
/// samples  samples of the patches that can be used, in the order of the frames
/// Errors   kInvalidArgument: an option out of range
///          kBadData: fewer than three exposure times of any light
[[nodiscard]] Result<Linearity> FitLinearity(const ChartReadings& readings,
                                             const std::vector<PatchSample>& samples,
                                             const LinearityOptions& options = {});

}  // namespace sateen
