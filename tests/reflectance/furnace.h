#pragma once

#include <cmath>
#include <string>

#include "core/error.h"
#include "reflectance/brdf.h"

namespace sateen {

// Tools with which the tests of reflectance models measure them. The normal is z.
inline const Eigen::Vector3d kNormal = Eigen::Vector3d::UnitZ();
inline const Eigen::Vector3d kWhite = Eigen::Vector3d::Ones();

inline Eigen::Vector3d DirectionAt(double n_d) { return {std::sqrt(1.0 - n_d * n_d), 0.0, n_d}; }

inline double AlbedoOf(const Brdf& brdf, double n_v, int side = 512) {
  return DirectionalAlbedo(brdf, kNormal, DirectionAt(n_v), side)[0];
}

// Largest |f(l, v) - f(v, l)| over pairs that are neither coplanar with n nor symmetric.
inline double ReciprocityError(const Brdf& brdf) {
  double worst = 0.0;
  for (const double n_l : {0.9, 0.5, 0.1, 0.01}) {
    for (const double n_v : {0.7, 0.3, 0.05}) {
      for (const double azimuth : {0.4, 1.7, 3.0}) {
        const double sine = std::sqrt(1.0 - n_l * n_l);
        const Eigen::Vector3d l(sine * std::cos(azimuth), sine * std::sin(azimuth), n_l);
        const Eigen::Vector3d v = DirectionAt(n_v);
        worst =
            std::max(worst, (brdf.Evaluate(kNormal, l, v) - brdf.Evaluate(kNormal, v, l)).norm());
      }
    }
  }
  return worst;
}

inline std::string MessageOf(const Status& status) {
  return status ? "valid" : status.error().message;
}

}  // namespace sateen
