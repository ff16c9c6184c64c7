#pragma once

#include "core/error.h"
#include "reflectance/brdf.h"
#include "reflectance/cosine_table.h"

namespace sateen {

// Diffuse reflection. `albedo` is rho, red, green and blue, each in [0, 1].
//
// Models with `energy_safe` are scaled, which is ours, so that no direction v gives back more than
// a given room(v) of the light that arrives:
//
//     f' = f s(n.l) s(n.v),  s(x) = min(1, room(x) / R(x))                                    (1)
//
// where R is the directional albedo of f at rho = 1. That stays reciprocal, leaves f alone where
// it has room in both directions, and needs no fit: s <= 1 makes the directional albedo of f' at
// most rho s(n.v) R(n.v) <= room(v). Constructing such a model fills the tables of R; the room
// keeps 0.003 back for their error.

struct LambertSpec {
  Eigen::Vector3d albedo = Eigen::Vector3d::Constant(0.5);

  // Fails with kInvalidArgument, which names the first field out of range, its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// f = rho / pi
class Lambert final : public Brdf {
 public:
  explicit Lambert(const LambertSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  LambertSpec spec_;
};

struct FresnelBalancedSpec {
  Eigen::Vector3d albedo = Eigen::Vector3d::Constant(0.5);
  Eigen::Vector3d f0 = Eigen::Vector3d::Constant(0.04);  // f0 of the Ggx on top, [0, 1]
  double alpha = 0.5;                                    // alpha of the Ggx on top, [0.001, 1]
  // Room: what a Ggx of this f0 and alpha leaves, so that both together conserve energy.
  bool energy_safe = true;

  [[nodiscard]] Status Validate() const;
};

/// f = (1 - F(v.h)) rho / pi           Neubelt and Pettineo 2013, eq. 15, F of Schlick; 0-06
///
/// Reciprocal, as h lies midway between l and v. As published it does not conserve energy: with
/// a Ggx of f0 = 0.04 and alpha = 0.2 on top, rho = 1 gives back 1.09 at n.v = 0.2.
/// Cost of construction: about 10 ms when energy_safe.
class FresnelBalancedLambert final : public Brdf {
 public:
  explicit FresnelBalancedLambert(const FresnelBalancedSpec& spec);
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  [[nodiscard]] Eigen::Array3d Share(double cosine) const;  // s of (1)

  FresnelBalancedSpec spec_;
  // Scale and bias of the Ggx; R at f0 = 0. Empty unless energy_safe.
  CosineTable<Eigen::Vector3d> parts_;
};

struct ShirleySpec {
  Eigen::Vector3d albedo = Eigen::Vector3d::Constant(0.5);
  Eigen::Vector3d f0 = Eigen::Vector3d::Constant(0.04);

  [[nodiscard]] Status Validate() const;
};

/// f = rho 21 / (20 pi) (1 - f0) (1 - (1 - n.l)^5) (1 - (1 - n.v)^5)
///
/// whose directional albedo is rho (1 - f0) (1 - (1 - n.v)^5): with a mirror of f0 on top, rho = 1
/// gives back all light at every angle.
/// Source: Shirley et al. 1997, as corrected by Chan 2018, eqs. 61 and 62; 1-25
class ShirleyDiffuse final : public Brdf {
 public:
  explicit ShirleyDiffuse(const ShirleySpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  ShirleySpec spec_;
};

struct MultiScatterSpec {
  Eigen::Vector3d albedo = Eigen::Vector3d::Constant(0.5);
  double gloss = 0.0;  // [0, 1]; gloss.h has its alpha
  // Room: 1. The specular reflection is not counted here; the fit itself assumes f0 = 0.04.
  bool energy_safe = true;

  [[nodiscard]] Status Validate() const;
};

/// Light scattered many times between Lambertian microfacets of gloss g, the hand-made fit:
///
///     f   = rho / pi (f_d + f_b)
///     f_d = f_0 + (f_1 - f_0) clamp(2.2 g - 0.5, 0, 1)
///     f_0 = l.h + (1 - l.h)^5
///     f_1 = (1 - 0.75 (1 - n.l)^5) (1 - 0.75 (1 - n.v)^5)
///     f_b = (34.5 g^2 - 59 g + 24.5) l.h 2^(-max(73.2 g - 21.2, 8.9) sqrt(n.h))
///
/// As published its directional albedo exceeds rho at grazing angles: 1.16 rho at most, at g = 0.
/// Source: Chan 2018, eqs. 64 to 69 and listing 1; 1-30
/// Cost of construction: about 25 ms when energy_safe.
class MultiScatterDiffuse final : public Brdf {
 public:
  explicit MultiScatterDiffuse(const MultiScatterSpec& spec);
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  MultiScatterSpec spec_;
  CosineTable<double> albedo_;  // R of (1); empty unless energy_safe
};

}  // namespace sateen
