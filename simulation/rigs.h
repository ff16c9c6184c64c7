#pragma once

#include "rig/rig.h"

namespace sateen {

// Returns `count` equal distant lights on a cone `polar_rad` from the zenith.
[[nodiscard]] Lights DistantRing(int count, double polar_rad);

// Returns the rings that a lamp's lens leaves around where its axis meets the table: from 1 by up
// to `amplitude`, `period_mm` from ring to ring, fading out by 250 mm.
[[nodiscard]] GainField LensRings(const Eigen::Vector2d& centre_mm, double amplitude,
                                  double period_mm);

// Returns `count` equal LEDs on a circle of a hemisphere of `radius_mm`, `polar_rad` from the
// zenith, each aimed at the table's origin; flux 1 gives irradiance 1 at 1 m. Those of the rung
// kLedField have lens rings of 3 %, each a little wider than the last.
[[nodiscard]] Lights LedRing(LightModel model, int count, double polar_rad, double radius_mm);

// Returns the scanner of The Order: 1886: ten LEDs on a hemisphere of 600 mm, and a camera 610 mm
// above the table that sees `width_mm` of it. flux_rgb is such that irradiance at the origin is 1.
[[nodiscard]] Rig RingRig(ImageSize size_px, LightModel model = LightModel::kNear,
                          double width_mm = 200.0);

}  // namespace sateen
