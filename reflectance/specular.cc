#include "reflectance/specular.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "reflectance/isotropic_angles.h"
#include "reflectance/microfacet.h"
#include "reflectance/range_check.h"

namespace sateen {
namespace {

constexpr double kLeastCosine = 1e-4;
constexpr double kLeastAlpha = 1e-3;

// Returns the same as AnglesBetween(), but n.v and n.h stay away from where the models divide by
// them.
IsotropicAngles SafeAngles(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                           const Eigen::Vector3d& v) {
  IsotropicAngles at = AnglesBetween(n, l, v);
  at.n_v = std::max(at.n_v, kLeastCosine);
  at.n_h = std::max(at.n_h, kLeastCosine);
  return at;
}

Status CheckSpecular(const Eigen::Vector3d& f0, double alpha) {
  return CheckColour("f0", f0).and_then(
      [&] { return CheckRange("alpha", alpha, kLeastAlpha, 1.0); });
}

}  // namespace

Status SpecularSpec::Validate() const { return CheckSpecular(f0, alpha); }

Status AnisotropicSpec::Validate() const {
  if (Status status = CheckRange("anisotropy", anisotropy, 0.0, 1.0); !status) {
    return status;
  }
  if (!(tangent.norm() > 1e-9 && tangent.allFinite())) {
    return Fail(ErrorCode::kInvalidArgument, "tangent has length {:g}; need more than 0",
                tangent.norm());
  }
  return CheckSpecular(f0, alpha);
}

Eigen::Vector3d Ggx::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                              const Eigen::Vector3d& v) const {
  const IsotropicAngles at = SafeAngles(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return GgxDistribution(at.n_h, spec_.alpha) * GgxVisibility(at.n_l, at.n_v, spec_.alpha) *
         SchlickFresnel(spec_.f0, at.l_h);
}

Eigen::Vector3d GgxAnisotropic::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const {
  const IsotropicAngles at = SafeAngles(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  // A tangent that points along the normal has no direction in the surface: any will do.
  Eigen::Vector3d t = spec_.tangent - n * n.dot(spec_.tangent);
  t = t.norm() > 1e-9 * spec_.tangent.norm() ? t.normalized() : n.unitOrthogonal();
  const Eigen::Vector3d b = n.cross(t);
  const double across = std::max(spec_.alpha * (1.0 - spec_.anisotropy), kLeastAlpha);
  const Eigen::Vector3d h = (l + v).normalized();
  return GgxDistribution({t.dot(h), b.dot(h), at.n_h}, spec_.alpha, across) *
         GgxVisibility(at.n_l, at.n_v, spec_.alpha) * SchlickFresnel(spec_.f0, at.l_h);
}

Eigen::Vector3d Beckmann::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                   const Eigen::Vector3d& v) const {
  const IsotropicAngles at = SafeAngles(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return BeckmannDistribution(at.n_h, spec_.alpha) * BeckmannMasking(at.n_l, spec_.alpha) *
         BeckmannMasking(at.n_v, spec_.alpha) / (4.0 * at.n_l * at.n_v) *
         SchlickFresnel(spec_.f0, at.l_h);
}

Eigen::Vector3d Cloth::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                const Eigen::Vector3d& v) const {
  const IsotropicAngles at = SafeAngles(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return VelvetDistribution(at.n_h, spec_.alpha) / (4.0 * (at.n_l + at.n_v - at.n_l * at.n_v)) *
         SchlickFresnel(spec_.f0, at.l_h);
}

}  // namespace sateen
