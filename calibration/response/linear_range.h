#pragma once

#include <optional>
#include <vector>

namespace sateen {

// Points of about one level.
struct LinearityBin {
  double level_dn = 0.0;   // above the dark
  double deviation = 0.0;  // measured / expected - 1
  double sd = 0.0;         // standard deviation of that
};

// Levels above the dark between which readings are proportional to exposure.
struct LinearRange {
  double from_dn = 0.0;
  double to_dn = 0.0;
  bool departs = false;  // true: the tolerance is left at to_dn; false: bins tell no further
};

/// Finds the range around the first bin above `start_dn` that is within the tolerance. A bin with
/// deviation delta and standard deviation sd
///
///     is certain where     sd <= tolerance / 2                                              (1)
///     is outside where     |delta| > tolerance + 2 sd                                       (2)
///
/// In both directions the range ends at the last bin that is certain and within the tolerance,
/// before the first that is outside. A noisy bin between others does not end it. If a bin above
/// that end is outside, or certain and beyond the tolerance, the range departs: it ends where a
/// straight line to the first such bin reaches the tolerance.
///
/// bins     from dark to bright
/// Returns  nothing where no bin above `start_dn` is within the tolerance
[[nodiscard]] std::optional<LinearRange> FindLinearRange(const std::vector<LinearityBin>& bins,
                                                         double start_dn, double tolerance);

}  // namespace sateen
