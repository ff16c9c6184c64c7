#pragma once

#include <Eigen/Core>

namespace sateen {

// How a surface reflects light: one interface for simulation, solver and material.
class Brdf {
 public:
  virtual ~Brdf() = default;

  // Returns f_r(l, v) at normal n; unit vectors, l and v away from the surface.
  // Zero where n . l <= 0. Red, green, blue. [1/sr]
  [[nodiscard]] virtual Eigen::Vector3d Evaluate(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                                                 const Eigen::Vector3d& v) const = 0;

 protected:
  Brdf() = default;
  Brdf(const Brdf&) = default;
  Brdf& operator=(const Brdf&) = default;
};

/// Returns the share of light from `v`'s mirror image that leaves again, or, by reciprocity, of the
/// light that arrives from everywhere and leaves towards v:
///
///     R(v) = integral over l of f_r(l, v) max(0, n . l) dl                                  (1)
///
/// by the midpoint rule on `side` x `side` cells of equal projected solid angle.
[[nodiscard]] Eigen::Vector3d DirectionalAlbedo(const Brdf& brdf, const Eigen::Vector3d& n,
                                                const Eigen::Vector3d& v, int side = 512);

}  // namespace sateen
