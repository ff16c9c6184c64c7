#pragma once

#include "simulation/surface.h"

namespace sateen {

enum class WeavePattern {
  kPlain,  // over one, under one
  kTwill,  // 2/2: over two, under two, moved by one from yarn to yarn
  kSatin,  // five-harness: the warp floats over four and is bound by one
  kRib,    // plain weave with two wefts laid in together: ribs along y
  kKnit    // jersey: columns of V-shaped loops
};

[[nodiscard]] std::optional<WeavePattern> WeavePatternNamed(std::string_view name);

/// Yarns as bodies of circular section, of which one sees the upper part:
///
///     z(s, d) = c(s) + sqrt(r^2 - d^2) - r cos e,   |d| <= w = r sin e                      (1)
///
/// s along the yarn, d across it, w half of its width, e the steepness at its edge, which
/// its flanks keep down to the ground. Its centre line
/// c rises by `amplitude` over a crossing yarn and sinks by it under one, on cosines between; the
/// highest yarn is seen, and the ground below all of them. The mean height is zero.
///
/// Warp yarns run along y, weft yarns along x. Parts: "warp", "weft", "ground"; a knit has "yarn"
/// and "ground".
struct WeaveSpec {
  WeavePattern pattern = WeavePattern::kPlain;
  double pitch_mm = 1.0;      // from yarn to yarn; of a knit from column to column
  double fill = 0.9;          // width of a yarn over its pitch, (0, 1]
  double edge_rad = 0.8;      // e, (0, pi/2)
  double amplitude_mm = 0.1;  // >= 0, less than would let a flank bury the next yarn's middle

  [[nodiscard]] Status Validate() const;
};

[[nodiscard]] Result<SurfacePtr> MakeWeave(const WeaveSpec& spec);

}  // namespace sateen
