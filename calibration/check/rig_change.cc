#include "calibration/check/rig_change.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace sateen {

int ChangeMask::Parameters(size_t sheet_count) const {
  return static_cast<int>(3 * std::ranges::count(moved, true) +
                          2 * std::ranges::count(turned, true)) +
         (camera ? 4 : 0) + (sheets ? 6 * static_cast<int>(sheet_count) : 0);
}

Light ChangedLight(const Light& light, const LightChange& change) {
  Light now = light;
  now.position_mm += change.moved_mm;
  now.field.origin_mm += change.moved_mm.head<2>();
  const Eigen::Vector3d a = light.axis.unitOrthogonal();
  const Eigen::Vector3d b = light.axis.cross(a);
  now.axis = (light.axis + change.turned_rad[0] * a + change.turned_rad[1] * b).normalized();
  now.flux_rgb.array() *= change.log_flux.array().exp();
  return now;
}

}  // namespace sateen
