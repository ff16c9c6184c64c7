#include "reflectance/blinn_phong.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reflectance/isotropic_angles.h"
#include "reflectance/microfacet.h"
#include "reflectance/range_check.h"

namespace sateen {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

}  // namespace

double PhongLobeFactor(double power) { return (power + 1.0) / kTwoPi; }

double PhongFactor(double power) { return (power + 2.0) / kTwoPi; }

double BlinnPhongLobeFactor(double power) {
  return (power + 2.0) / (2.0 * kTwoPi * (2.0 - std::exp2(-0.5 * power)));
}

double BlinnPhongFactor(double power) {
  return (power + 2.0) * (power + 4.0) / (4.0 * kTwoPi * (std::exp2(-0.5 * power) + power));
}

double CheapBlinnPhongFactor(double power) { return (power + 8.0) / (4.0 * kTwoPi); }

double BlinnDistribution(double n_m, double power) {
  return (power + 2.0) / kTwoPi * std::pow(n_m, power);
}

double BlinnLobeGaussian(double n_h, double power) {
  return std::exp2(power * std::numbers::log2e * (n_h - 1.0));
}

double BlinnLobeGaussianLowPower(double n_h, double power) {
  return std::exp2((power + 1.0) * std::numbers::log2e * (n_h - 1.0));
}

double SchlickWeightGaussian(double v_h) { return std::exp2(-8.656170 * v_h); }

double SchlickWeightGaussianQuadratic(double v_h) {
  return std::exp2((-5.55473 * v_h - 6.98316) * v_h);
}

Status BlinnPhongSpec::Validate() const {
  if (Status status = CheckColour("f0", f0); !status) {
    return status;
  }
  return CheckRange("power", power, 0.0, 1e6);
}

Status DirectLightingSpec::Validate() const {
  if (Status status = diffuse.Validate(); !status) {
    return status;
  }
  return specular.Validate();
}

Eigen::Vector3d BlinnPhong::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                     const Eigen::Vector3d& v) const {
  const IsotropicAngles at = AnglesBetween(n, l, v);
  if (at.n_l <= 0.0) {
    return Eigen::Vector3d::Zero();
  }
  return 0.25 * BlinnDistribution(at.n_h, spec_.power) * SchlickFresnel(spec_.f0, at.l_h);
}

Eigen::Vector3d DirectLighting::Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const {
  return diffuse_.Evaluate(n, l, v) + specular_.Evaluate(n, l, v);
}

Eigen::Vector3d PunctualRadiance(const Brdf& brdf, const Eigen::Vector3d& n,
                                 const Eigen::Vector3d& l, const Eigen::Vector3d& v,
                                 const Eigen::Vector3d& light_colour) {
  const double n_l = std::max(0.0, n.dot(l));
  return std::numbers::pi * n_l * brdf.Evaluate(n, l, v).cwiseProduct(light_colour);
}

}  // namespace sateen
