#include "rig/pixel_pitch.h"

#include <cmath>

#include "rig/projection.h"

namespace sateen {

std::optional<double> PixelPitchMm(const Camera& camera) {
  const double u = 0.5 * (camera.size_px.width - 1);
  const double v = 0.5 * (camera.size_px.height - 1);
  const std::optional<Eigen::Vector3d> middle = TablePointOfPixel(camera, u, v);
  const std::optional<Eigen::Vector3d> right = TablePointOfPixel(camera, u + 1.0, v);
  const std::optional<Eigen::Vector3d> down = TablePointOfPixel(camera, u, v + 1.0);
  if (!middle || !right || !down) {
    return std::nullopt;
  }
  const double area_mm2 = (*right - *middle).cross(*down - *middle).norm();
  return area_mm2 > 0.0 ? std::optional(std::sqrt(area_mm2)) : std::nullopt;
}

}  // namespace sateen
