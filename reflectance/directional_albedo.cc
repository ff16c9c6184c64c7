#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "reflectance/brdf.h"

namespace sateen {

Eigen::Vector3d DirectionalAlbedo(const Brdf& brdf, const Eigen::Vector3d& n,
                                  const Eigen::Vector3d& v, int side) {
  const Eigen::Vector3d tangent = n.unitOrthogonal();
  const Eigen::Vector3d bitangent = n.cross(tangent);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < side; ++i) {
    const double sin2 = (i + 0.5) / side;
    for (int j = 0; j < side; ++j) {
      const double phi = 2.0 * std::numbers::pi * (j + 0.5) / side;
      const Eigen::Vector3d l =
          std::sqrt(sin2) * (std::cos(phi) * tangent + std::sin(phi) * bitangent) +
          std::sqrt(1.0 - sin2) * n;
      sum += brdf.Evaluate(n, l, v);
    }
  }
  return sum * std::numbers::pi / (static_cast<double>(side) * side);
}

}  // namespace sateen
