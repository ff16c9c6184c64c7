#pragma once

#include "reflectance/diffuse.h"

namespace sateen {

// Lagarde's specular model ("Adopting a physically based shading model", 2011). n is the specular
// power; gloss.h turns it into gloss and alpha. Each factor makes the integral that it is named
// after equal 1 at v = n:                                                                    2-01

/// (n + 1) / (2 pi): of (r.v)^n over directions                                              [1/sr]
[[nodiscard]] double PhongLobeFactor(double power);

/// (n + 2) / (2 pi): of (r.v)^n (n.l)                                                        [1/sr]
[[nodiscard]] double PhongFactor(double power);

/// (n + 2) / (4 pi (2 - 2^(-n/2))): of (n.h)^n over directions                               [1/sr]
[[nodiscard]] double BlinnPhongLobeFactor(double power);

/// (n + 2) (n + 4) / (8 pi (2^(-n/2) + n)): of (n.h)^n (n.l)                                 [1/sr]
[[nodiscard]] double BlinnPhongFactor(double power);

/// (n + 8) / (8 pi): the cheap form of BlinnPhongFactor; 7 % too much at n = 10              [1/sr]
[[nodiscard]] double CheapBlinnPhongFactor(double power);

/// D = (n + 2) / (2 pi) (n.m)^n, which has projected area 1                            2-02  [1/sr]
[[nodiscard]] double BlinnDistribution(double n_m, double power);

// Spherical Gaussians in place of powers                                                     2-07

/// (n.h)^n ~ 2^(n / ln(2) (n.h - 1)), for high powers
[[nodiscard]] double BlinnLobeGaussian(double n_h, double power);

/// (n.h)^n ~ 2^((n + 1) / ln(2) (n.h - 1)), for low powers
[[nodiscard]] double BlinnLobeGaussianLowPower(double n_h, double power);

/// (1 - x)^5 ~ 2^(-8.656170 x), x = v.h; off by 0.042 at most
[[nodiscard]] double SchlickWeightGaussian(double v_h);

/// (1 - x)^5 ~ 2^((-5.55473 x - 6.98316) x); off by 0.0038 at most       Lagarde 2012
[[nodiscard]] double SchlickWeightGaussianQuadratic(double v_h);

struct BlinnPhongSpec {
  Eigen::Vector3d f0 = Eigen::Vector3d::Constant(0.04);  // reflectance at normal incidence, [0, 1]
  double power = 64.0;                                   // n, [0, 1e6]

  // Fails with kInvalidArgument, which names the first field out of range, its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// f = D F G / (4 (n.l) (n.v)) = (n + 2) / (8 pi) (n.h)^n F,   G = (n.l) (n.v), F of Schlick
///
/// One code for dielectrics, whose f0 is grey, and metals, whose f0 has a colour; 2-06.
class BlinnPhong final : public Brdf {
 public:
  explicit BlinnPhong(const BlinnPhongSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  BlinnPhongSpec spec_;
};

struct DirectLightingSpec {
  LambertSpec diffuse;
  BlinnPhongSpec specular;

  [[nodiscard]] Status Validate() const;
};

/// The direct lighting model, Lambert + BlinnPhong. Under a punctual light (below) it returns
///
///     L_o = (c_diff + (n + 2) / 8 (n.h)^n F) c_light (n.l)                               2-03
///
/// As published nothing keeps diffuse and specular together below 1.
class DirectLighting final : public Brdf {
 public:
  explicit DirectLighting(const DirectLightingSpec& spec)
      : spec_(spec), diffuse_(spec.diffuse), specular_(spec.specular) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  DirectLightingSpec spec_;
  Lambert diffuse_;
  BlinnPhong specular_;
};

/// L_o = pi f(l, v) c_light max(0, n.l)                                                 2-04
///
/// from a light in one direction l, whose colour is that of a white Lambertian surface facing it.
[[nodiscard]] Eigen::Vector3d PunctualRadiance(const Brdf& brdf, const Eigen::Vector3d& n,
                                               const Eigen::Vector3d& l, const Eigen::Vector3d& v,
                                               const Eigen::Vector3d& light_colour);

}  // namespace sateen
