#pragma once

#include <Eigen/Core>
#include <string_view>

namespace sateen {

enum class LobeModel {
  kCloth,          // fuzz, of reflectance/specular.h's Cloth
  kGgx,            // gloss, of its Ggx
  kGgxAnisotropic  // gloss of yarns, of its GgxAnisotropic
};

// "cloth", "ggx", "ggx-anisotropic", as scene files name them.
[[nodiscard]] std::string_view Name(LobeModel model);

// Rung 3 of solver/ladder.h: what a whole scene reflects at its surface, over a Lambertian body.
struct Lobe {
  LobeModel model = LobeModel::kCloth;
  double alpha = 0.0;     // roughness; of yarns, across their fibres
  double strength = 0.0;  // times the model with F0 = 0.04
  // Of kGgxAnisotropic: roughness along the fibres, and from x to where `alpha` counts, on the table, of warp
  // or weft, [0, 180).
  double alpha_along = 0.0;
  double azimuth_deg = 0.0;
  double share = 1.0;  // of the pixels that have it
};

// Half vector of l and v, and Schlick's share of a dielectric of F0 = 0.04 there: what does not depend on n.
struct LobeHalf {
  Eigen::Vector3d h;
  double fresnel;
};
[[nodiscard]] LobeHalf LobeHalfOf(const Eigen::Vector3d& l, const Eigen::Vector3d& v);

// Equation (13)'s s at a unit n, and its gradient across n.
struct LobeTerm {
  double value = 0.0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

// A lobe made ready for many terms.
class LobeShape {
 public:
  explicit LobeShape(const Lobe& lobe);

  [[nodiscard]] LobeTerm At(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                            const Eigen::Vector3d& v, const LobeHalf& half) const;

 private:
  // D of GGX and its gradient.
  [[nodiscard]] LobeTerm DistributionAt(const Eigen::Vector3d& n, const Eigen::Vector3d& h) const;

  Lobe lobe_;
  Eigen::Vector3d tangent_;
};

}  // namespace sateen
