#include "reflectance/specular.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "reflectance/microfacet.h"

namespace sateen {
namespace {

constexpr double kLeastCosine = 1e-4;
constexpr double kLeastAlpha = 1e-3;

// The angles that an isotropic model depends on.
struct Cosines {
  Eigen::Vector3d h;
  double n_l;
  double n_v;
  double n_h;
  double v_h;
};

Cosines CosinesOf(const Eigen::Vector3d& n, const Eigen::Vector3d& l, const Eigen::Vector3d& v) {
  const Eigen::Vector3d h = (l + v).normalized();
  return {h, n.dot(l), std::max(n.dot(v), kLeastCosine), std::clamp(n.dot(h), kLeastCosine, 1.0),
          std::max(v.dot(h), 0.0)};
}

Status CheckSpecular(const Eigen::Vector3d& f0, double alpha) {
  for (const double value : f0) {
    if (!(value >= 0.0 && value <= 1.0)) {
      return Fail(ErrorCode::kInvalidArgument, "f0 = {:g}; need 0 to 1", value);
    }
  }
  if (!(alpha >= kLeastAlpha && alpha <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "alpha = {:g}; need {:g} to 1", alpha, kLeastAlpha);
  }
  return {};
}

}  // namespace

Status SpecularSpec::Validate() const { return CheckSpecular(f0, alpha); }

Status AnisotropicSpec::Validate() const {
  if (!(anisotropy >= 0.0 && anisotropy <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "anisotropy = {:g}; need 0 to 1", anisotropy);
  }
  if (!(tangent.norm() > 1e-9 && tangent.allFinite())) {
    return Fail(ErrorCode::kInvalidArgument, "tangent has length {:g}; need more than 0",
                tangent.norm());
  }
  return CheckSpecular(f0, alpha);
}

Eigen::Vector3d Ggx::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                              const Eigen::Vector3d& v) const {
  const Cosines at = CosinesOf(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return GgxDistribution(at.n_h, spec_.alpha) * GgxVisibility(at.n_l, at.n_v, spec_.alpha) *
         SchlickFresnel(spec_.f0, at.v_h);
}

Eigen::Vector3d GgxAnisotropic::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const {
  const Cosines at = CosinesOf(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  // A yarn that points along the normal has no direction in the surface: any will do.
  Eigen::Vector3d t = spec_.tangent - n * n.dot(spec_.tangent);
  t = t.norm() > 1e-9 * spec_.tangent.norm() ? t.normalized() : n.unitOrthogonal();
  const Eigen::Vector3d b = n.cross(t);
  const double across = std::max(spec_.alpha * (1.0 - spec_.anisotropy), kLeastAlpha);
  return GgxDistribution({t.dot(at.h), b.dot(at.h), at.n_h}, spec_.alpha, across) *
         GgxVisibility(at.n_l, at.n_v, spec_.alpha) * SchlickFresnel(spec_.f0, at.v_h);
}

Eigen::Vector3d Beckmann::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                   const Eigen::Vector3d& v) const {
  const Cosines at = CosinesOf(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return BeckmannDistribution(at.n_h, spec_.alpha) * BeckmannMasking(at.n_l, spec_.alpha) *
         BeckmannMasking(at.n_v, spec_.alpha) / (4.0 * at.n_l * at.n_v) *
         SchlickFresnel(spec_.f0, at.v_h);
}

Eigen::Vector3d Cloth::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                const Eigen::Vector3d& v) const {
  const Cosines at = CosinesOf(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return VelvetDistribution(at.n_h, spec_.alpha) / (4.0 * (at.n_l + at.n_v - at.n_l * at.n_v)) *
         SchlickFresnel(spec_.f0, at.v_h);
}

}  // namespace sateen
