#pragma once

#include "core/error.h"
#include "reflectance/brdf.h"

namespace sateen {

// Surface reflection of The Order: 1886 (Neubelt and Pettineo 2013): D V F with the parts of
// reflectance/microfacet.h. n . v is at least 1e-4, so that a normal that is turned away from the
// viewer stays continuous (their eq. 10).
struct SpecularSpec {
  Eigen::Vector3d f0 = Eigen::Vector3d::Constant(0.04);  // reflectance at normal incidence, [0, 1]
  double alpha = 0.5;                                    // roughness, [0.001, 1]

  // Fails with kInvalidArgument, which names the first field out of range, its value and its range.
  [[nodiscard]] Status Validate() const;
};

// GGX with Smith's masking of light and view, uncorrelated.
class Ggx final : public Brdf {
 public:
  explicit Ggx(const SpecularSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  SpecularSpec spec_;
};

struct AnisotropicSpec {
  Eigen::Vector3d f0 = Eigen::Vector3d::Constant(0.04);
  double alpha = 0.5;       // along the tangent
  double anisotropy = 0.0;  // [0, 1]: across it max(alpha (1 - anisotropy), 0.001)
  // Direction in which it is rough: across the fibres of a yarn. Its part in the plane of the
  // surface counts. Not zero.
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();

  [[nodiscard]] Status Validate() const;
};

// GGX with different roughness along and across; its visibility is that of `alpha`.
class GgxAnisotropic final : public Brdf {
 public:
  explicit GgxAnisotropic(const AnisotropicSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  AnisotropicSpec spec_;
};

class Beckmann final : public Brdf {
 public:
  explicit Beckmann(const SpecularSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  SpecularSpec spec_;
};

// Fuzz: f = F D_velvet / (4 (n.l + n.v - n.l n.v)), their eq. 23.
class Cloth final : public Brdf {
 public:
  explicit Cloth(const SpecularSpec& spec) : spec_(spec) {}
  [[nodiscard]] Status Validate() const { return spec_.Validate(); }
  [[nodiscard]] Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                         const Eigen::Vector3d& v) const override;

 private:
  SpecularSpec spec_;
};

}  // namespace sateen
