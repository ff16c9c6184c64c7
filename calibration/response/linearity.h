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
  double tolerance = 0.01;  // of proportionality to exposure; (0, 0.2]

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// A sample beside what exposure time says of it. [DN above the dark]
struct LinearityPoint {
  size_t colour = 0;
  double expected_dn = 0.0;
  double measured_dn = 0.0;
  bool is_clipped = false;  // some of its sites are saturated
};

struct ChannelLinearity {
  std::vector<LinearityBin> bins;  // from dark to bright, of points that are not clipped
  // Readings from here on are saturated. Nothing: no patch was. [DN as read]
  std::optional<double> saturation_dn;
  // Proportional to within the tolerance from here ... [DN as read]
  double linear_from_dn = 0.0;
  double linear_to_dn = 0.0;  // ... to here, which is as high as bins tell, or
  bool departs = false;       // where the tolerance is left
  // Proportional to within kFineTolerance up to here, for what needs more than the range: the
  // exposure of sheets. Nothing: readings do not tell. [DN as read]
  std::optional<double> fine_to_dn;
};

// How bright a frame is against its light's others, by its own exposure time; 1 where they agree.
struct FrameBrightness {
  size_t frame = 0;
  double ratio = 1.0;
};

struct Linearity {
  std::array<ChannelLinearity, 3> rgb;
  std::vector<LinearityPoint> points;
  std::vector<FrameBrightness> frames;  // those with something between dark and half of white
};

/// Proportionality of readings to exposure time, whatever the light does on the chart: for each
/// light p, patch and colour
///
///     s = a_p f(t),      a_p by least squares over signals of 3 to 50 % of the range         (1)
///     deviation = s / (a_p t) - 1                                                           (2)
///
/// over all patches and all lights of three exposure times or more, in bins of 3 %; the range is that of
/// FindLinearRange() upwards and downwards of (1)'s lowest level. What a light, a patch or a colour
/// does to brightness cancels in (2). A wrong exposure time or a light that flickers does not, and
/// shows in all patches of its frame: their median there counts as a standard deviation beside the noise,
/// so that one such frame does not end the range.
///
/// Saturated are patches that should read a tenth more than any does: the level is the median of their
/// sites less three robust standard deviations.
///
/// samples  of the patches that can be used, in the order of the frames
/// Errors   kInvalidArgument: an option out of range
///          kBadData: fewer than three exposure times of any light
[[nodiscard]] Result<Linearity> FitLinearity(const ChartReadings& readings,
                                             const std::vector<PatchSample>& samples,
                                             const LinearityOptions& options = {});

}  // namespace sateen
