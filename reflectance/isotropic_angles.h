#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>

namespace sateen {

// Angles that an isotropic model depends on: cosines between n, l, v and the half vector h. n_l
// keeps its sign, so that a model can return 0 for light from below; the others are in [0, 1].
struct IsotropicAngles {
  double n_l;
  double n_v;
  double n_h;
  double l_h;
};

// The order of the arguments of max turns NaN into 0.
inline double UnitCosine(double x) { return std::min(std::max(0.0, x), 1.0); }

inline IsotropicAngles AnglesBetween(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                     const Eigen::Vector3d& v) {
  const Eigen::Vector3d h = (l + v).normalized();
  return {n.dot(l), UnitCosine(n.dot(v)), UnitCosine(n.dot(h)), UnitCosine(l.dot(h))};
}

/// (1 - x)^5, the angular part of Schlick's Fresnel term
inline double SchlickWeight(double x) {
  const double y = 1.0 - x;
  return y * y * y * y * y;
}

}  // namespace sateen
