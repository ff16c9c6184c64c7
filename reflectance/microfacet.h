#pragma once

#include <Eigen/Core>

namespace sateen {

// Parts of microfacet models. alpha in (0, 1]; cosines of angles to the normal n.

/// D = alpha^2 / (pi ((n.m)^2 (alpha^2 - 1) + 1)^2)          Walter et al. 2007; 0-01      [1/sr]
[[nodiscard]] double GgxDistribution(double n_m, double alpha);

/// The same stretched: alpha_t along the tangent t and alpha_b across, of half vector components
/// t.m, b.m, n.m:  D = 1 / (pi alpha_t alpha_b ((t.m / alpha_t)^2 + (b.m / alpha_b)^2 + (n.m)^2)^2)
[[nodiscard]] double GgxDistribution(const Eigen::Vector3d& m_in_tbn, double alpha_t,
                                     double alpha_b);

/// G1 = 2 x / (x + sqrt(x^2 + alpha^2 (1 - x^2))), x = n.v            Smith's masking; 0-02
[[nodiscard]] double GgxMasking(double n_v, double alpha);

/// V = G1(l) G1(v) / (4 (n.l) (n.v)), finite at grazing angles                          0-03
[[nodiscard]] double GgxVisibility(double n_l, double n_v, double alpha);

/// D = exp(-tan^2 / alpha^2) / (pi alpha^2 cos^4)                                0-35    [1/sr]
[[nodiscard]] double BeckmannDistribution(double n_m, double alpha);

/// Walter's rational fit: a = 1 / (alpha tan), (3.535 a + 2.181 a^2) / (1 + 2.276 a + 2.577 a^2)
/// for a < 1.6, otherwise 1.                                                             0-35
[[nodiscard]] double BeckmannMasking(double n_v, double alpha);

/// D = (1 + 4 exp(-cot^2 / alpha^2) / sin^4) / (pi (1 + 4 alpha^2))   velvet; 0-09       [1/sr]
[[nodiscard]] double VelvetDistribution(double n_m, double alpha);

/// F = f0 + (1 - f0) (1 - v.h)^5                                       Schlick 1994; 0-36
[[nodiscard]] Eigen::Vector3d SchlickFresnel(const Eigen::Vector3d& f0, double v_h);

}  // namespace sateen
