#include "reflectance/diffuse.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reflectance/environment_brdf.h"
#include "reflectance/isotropic_angles.h"
#include "reflectance/microfacet.h"
#include "reflectance/range_check.h"

namespace sateen {
namespace {

constexpr double kInvPi = std::numbers::inv_pi;
constexpr int kAlbedoCells = 32;
// Kept back of the room, so that errors of the tables (measured: up to 0.0024) create no light.
constexpr double kTableError = 0.003;

// Returns R of a reciprocal isotropic model, in its first colour, at a view of this cosine.
double AlbedoAt(const Brdf& brdf, double n_v, int side) {
  const Eigen::Vector3d v(std::sqrt(1.0 - n_v * n_v), 0.0, n_v);
  return DirectionalAlbedo(brdf, Eigen::Vector3d::UnitZ(), v, side)[0];
}

}  // namespace

Status LambertSpec::Validate() const { return CheckColour("albedo", albedo); }

Status FresnelBalancedSpec::Validate() const {
  if (Status status = CheckColour("albedo", albedo); !status) {
    return status;
  }
  if (Status status = CheckColour("f0", f0); !status) {
    return status;
  }
  return CheckRange("alpha", alpha, 0.001, 1.0);
}

Status ShirleySpec::Validate() const {
  if (Status status = CheckColour("albedo", albedo); !status) {
    return status;
  }
  return CheckColour("f0", f0);
}

Status MultiScatterSpec::Validate() const {
  if (Status status = CheckColour("albedo", albedo); !status) {
    return status;
  }
  return CheckRange("gloss", gloss, 0.0, 1.0);
}

Eigen::Vector3d Lambert::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                  const Eigen::Vector3d& /*v*/) const {
  return n.dot(l) > 0.0 ? Eigen::Vector3d(spec_.albedo * kInvPi) : Eigen::Vector3d::Zero();
}

FresnelBalancedLambert::FresnelBalancedLambert(const FresnelBalancedSpec& spec) : spec_(spec) {
  if (!spec.energy_safe) {
    return;
  }
  const FresnelBalancedLambert without_f0(
      {.albedo = Eigen::Vector3d::Ones(), .f0 = Eigen::Vector3d::Zero(), .energy_safe = false});
  parts_ = {kAlbedoCells, [&](double n_v) -> Eigen::Vector3d {
              const Eigen::Vector2d ggx = IntegrateEnvironmentBrdf(n_v, spec.alpha);
              return {ggx[0], ggx[1], AlbedoAt(without_f0, n_v, /*side=*/64)};
            }};
}

Eigen::Array3d FresnelBalancedLambert::Share(double cosine) const {
  const Eigen::Vector3d parts = parts_.At(cosine);
  const Eigen::Array3d f0 = spec_.f0.array();
  const Eigen::Array3d room = (1.0 - kTableError - f0 * parts[0] - parts[1]).max(0.0);
  const Eigen::Array3d albedo = (1.0 - f0) * parts[2];
  return (albedo > room).select(room / albedo, 1.0);
}

Eigen::Vector3d FresnelBalancedLambert::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                                 const Eigen::Vector3d& v) const {
  const IsotropicAngles at = AnglesBetween(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  const Eigen::Vector3d fresnel = SchlickFresnel(spec_.f0, at.l_h);
  Eigen::Array3d f = (1.0 - fresnel.array()) * spec_.albedo.array() * kInvPi;
  if (!parts_.Empty()) {
    f *= Share(at.n_l) * Share(at.n_v);
  }
  return f;
}

Eigen::Vector3d ShirleyDiffuse::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const {
  const IsotropicAngles at = AnglesBetween(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  const double angular = (1.0 - SchlickWeight(at.n_l)) * (1.0 - SchlickWeight(at.n_v));
  return (21.0 / 20.0) * kInvPi * angular * (1.0 - spec_.f0.array()) * spec_.albedo.array();
}

MultiScatterDiffuse::MultiScatterDiffuse(const MultiScatterSpec& spec) : spec_(spec) {
  if (!spec.energy_safe) {
    return;
  }
  const MultiScatterDiffuse published(
      {.albedo = Eigen::Vector3d::Ones(), .gloss = spec.gloss, .energy_safe = false});
  albedo_ = {kAlbedoCells, [&](double n_v) { return AlbedoAt(published, n_v, /*side=*/128); }};
}

Eigen::Vector3d MultiScatterDiffuse::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                              const Eigen::Vector3d& v) const {
  const IsotropicAngles at = AnglesBetween(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  const double g = spec_.gloss;
  const double f_0 = at.l_h + SchlickWeight(at.l_h);
  const double f_1 = (1.0 - 0.75 * SchlickWeight(at.n_l)) * (1.0 - 0.75 * SchlickWeight(at.n_v));
  const double f_d = f_0 + (f_1 - f_0) * std::clamp(2.2 * g - 0.5, 0.0, 1.0);
  const double f_b = (34.5 * g * g - 59.0 * g + 24.5) * at.l_h *
                     std::exp2(-std::max(73.2 * g - 21.2, 8.9) * std::sqrt(at.n_h));
  double share = 1.0;
  if (!albedo_.Empty()) {
    constexpr double kRoom = 1.0 - kTableError;
    share = std::min(1.0, kRoom / albedo_.At(at.n_l)) * std::min(1.0, kRoom / albedo_.At(at.n_v));
  }
  return spec_.albedo * (kInvPi * (f_d + f_b) * share);
}

}  // namespace sateen
