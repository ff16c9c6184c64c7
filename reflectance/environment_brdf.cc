#include "reflectance/environment_brdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reflectance/microfacet.h"

namespace sateen {
namespace {

constexpr int kTableCells = 32;
constexpr int kPolarSteps = 64;
constexpr int kAzimuthSteps = 32;  // over half a turn: the other half is its mirror image

}  // namespace

Eigen::Vector2d IntegrateEnvironmentBrdf(double n_v, double alpha) {
  n_v = std::max(n_v, 1e-4);  // as Ggx does
  const double v_x = std::sqrt(1.0 - n_v * n_v);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int i = 0; i < kPolarSteps; ++i) {
    // The drawn number u = 1 - s^2: denser where normals lie flat, which is where most of the error
    // of equal steps in u would come from. Its weight is du / ds = 2 s.
    const double s = (i + 0.5) / kPolarSteps;
    const double n_m = s / std::sqrt(alpha * alpha + (1.0 - alpha * alpha) * s * s);
    const double m_x = std::sqrt(std::max(1.0 - n_m * n_m, 0.0));
    for (int j = 0; j < kAzimuthSteps; ++j) {
      const double phi = std::numbers::pi * (j + 0.5) / kAzimuthSteps;
      const double v_m = v_x * m_x * std::cos(phi) + n_v * n_m;
      const double n_l = 2.0 * v_m * n_m - n_v;
      if (n_l <= 0.0) {
        continue;
      }
      // (3)
      const double w = 2.0 * s * 4.0 * GgxVisibility(n_l, n_v, alpha) * n_l * v_m / n_m;
      const double fresnel = SchlickWeight(std::min(v_m, 1.0));
      sum += w * Eigen::Vector2d(1.0 - fresnel, fresnel);  // (2)
    }
  }
  return sum / (kPolarSteps * kAzimuthSteps);
}

EnvironmentBrdf::EnvironmentBrdf() {
  rows_.reserve(kTableCells + 1);
  for (int j = 0; j <= kTableCells; ++j) {
    const double alpha = NodePosition(j, kTableCells);
    rows_.emplace_back(kTableCells,
                       [alpha](double n_v) { return IntegrateEnvironmentBrdf(n_v, alpha); });
  }
}

Eigen::Vector2d EnvironmentBrdf::ScaleAndBias(double n_v, double alpha) const {
  const NodeCell cell = CellOf(alpha, kTableCells);
  const auto first = static_cast<std::size_t>(cell.first);
  return (1.0 - cell.fraction) * rows_[first].At(n_v) + cell.fraction * rows_[first + 1].At(n_v);
}

Eigen::Vector3d EnvironmentBrdf::Reflectance(double n_v, const Eigen::Vector3d& f0,
                                             double alpha) const {
  const Eigen::Vector2d terms = ScaleAndBias(n_v, alpha);
  return f0 * terms[0] + Eigen::Vector3d::Constant(terms[1]);
}

Eigen::Vector3d EnvironmentBrdf::DiffuseShare(double n_l, const Eigen::Vector3d& f0,
                                              double alpha) const {
  return Eigen::Vector3d::Ones() - Reflectance(n_l, f0, alpha);
}

}  // namespace sateen
