#pragma once

#include <Eigen/Core>
#include <vector>

#include "reflectance/cosine_table.h"

namespace sateen {

/// The two parts of the directional albedo of Ggx (specular.h), which is linear in f0:
///
///     R(n.v) = integral over l of f_r (n.l) dl = f0 scale + bias                             (1)
///     scale  = mean over m of w (1 - c),  bias = mean over m of w c,  c = (1 - v.m)^5         (2)
///     w      = 4 V (n.l) (v.m) / (n.m),  l = 2 (v.m) m - v                                   (3)
///
/// with normals m drawn in proportion to D(m) (n.m), on a midpoint grid in place of at random.
///
/// n_v      [0, 1], at least 1e-4 inside; alpha [0, 1], where 0 is a mirror
/// Returns  {scale, bias}
/// Cost     2,048 normals; about 25 us
/// Source   Karis 2013, "Real Shading in Unreal Engine 4"; Chan 2018, sections 4.7 and 5.3
[[nodiscard]] Eigen::Vector2d IntegrateEnvironmentBrdf(double n_v, double alpha);

// The same from a table of 33 x 33 nodes over n.v and alpha, interpolated between them. By
// reciprocity it also tells what share of the light from l is lost to the specular reflection.
// The constructor fills the table in about 30 ms: build one and share it.
class EnvironmentBrdf {
 public:
  EnvironmentBrdf();

  // Returns {scale, bias}. n_v and alpha in [0, 1].
  [[nodiscard]] Eigen::Vector2d ScaleAndBias(double n_v, double alpha) const;

  /// R = f0 scale + bias
  [[nodiscard]] Eigen::Vector3d Reflectance(double n_v, const Eigen::Vector3d& f0,
                                            double alpha) const;

  /// 1 - R(n.l): what the specular reflection leaves to the diffuse one  Chan, listing 5; 1-24
  [[nodiscard]] Eigen::Vector3d DiffuseShare(double n_l, const Eigen::Vector3d& f0,
                                             double alpha) const;

 private:
  std::vector<CosineTable<Eigen::Vector2d>> rows_;  // one for each node of alpha
};

}  // namespace sateen
