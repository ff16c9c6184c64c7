#pragma once

#include <optional>
#include <vector>

namespace sateen {

// Points of about one level. [DN above the dark]
struct LinearityBin {
  double level_dn = 0.0;
  double deviation = 0.0;  // measured / expected - 1
  double sd = 0.0;         // of that
};

// Levels over which readings are proportional to exposure. [DN above the dark]
struct LinearRange {
  double from_dn = 0.0;
  double to_dn = 0.0;    // as high as bins tell, or
  bool departs = false;  // where the tolerance is left
};

/// The range from the first bin above `start_dn` that is within the tolerance outwards. With deviation
/// delta and standard deviation sd, a bin
///
///     tells where          sd <= tolerance / 2                                             (1)
///     leaves it where      |delta| > tolerance + 2 sd                                       (2)
///
/// Either way the range goes to the last bin that tells that it is within the tolerance before the
/// first that leaves it: a noisy bin between others ends no range. Upwards, where bins beyond that one
/// leave it or tell that they are off, it departs: it goes on to where a straight line to the first of
/// them is as far off as the tolerance.
///
/// bins     from dark to bright
/// Returns  nothing where no bin above `start_dn` is within the tolerance
[[nodiscard]] std::optional<LinearRange> FindLinearRange(const std::vector<LinearityBin>& bins,
                                                         double start_dn, double tolerance);

}  // namespace sateen
