#pragma once

#include <optional>

#include "rig/camera.h"

namespace sateen {

/// Returns the distance between neighbouring pixels on the table, at the middle of the image. [mm]
///
///     u = (width - 1) / 2, v = (height - 1) / 2
///     pitch = sqrt(|(p(u + 1, v) - p(u, v)) x (p(u, v + 1) - p(u, v))|)
///
/// where p(u, v) is TablePointOfPixel(): the side of a square of the pixel's area, whatever fx, fy
/// and the camera's tilt are. Nothing where the middle of the image does not see the table.
[[nodiscard]] std::optional<double> PixelPitchMm(const Camera& camera);

}  // namespace sateen
