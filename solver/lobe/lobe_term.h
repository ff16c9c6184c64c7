#pragma once

#include <Eigen/Core>

#include "solver/normal_field.h"

namespace sateen {

// Factors of a lobe that do not depend on n.
struct LobeHalf {
  Eigen::Vector3d h;  // half vector of l and v
  double fresnel;     // Schlick's reflectance of a dielectric of F0 = 0.04 there
};
[[nodiscard]] LobeHalf LobeHalfOf(const Eigen::Vector3d& l, const Eigen::Vector3d& v);

// s of (1) of solver/lobe/lobe.h at a unit n, and its gradient across n.
struct LobeTerm {
  double value = 0.0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

// A lobe prepared for many terms.
class LobeShape {
 public:
  explicit LobeShape(const Lobe& lobe);

  [[nodiscard]] LobeTerm At(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                            const Eigen::Vector3d& v, const LobeHalf& half) const;

 private:
  // Returns GGX's D and its gradient.
  [[nodiscard]] LobeTerm DistributionAt(const Eigen::Vector3d& n, const Eigen::Vector3d& h) const;

  Lobe lobe_;
  Eigen::Vector3d tangent_;
};

}  // namespace sateen
