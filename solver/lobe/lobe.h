#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "solver/least_squares/pixel_system.h"
#include "solver/lobe/lobe_term.h"
#include "solver/noise.h"

/// Rung 3 of solver/ladder.h: a Lambertian body under a lobe that the whole scene has in common.
///
///     i'_k = N . l_k + s_k(n),  s_k = a pi f(n, l_k, v) max(0, n . l_k), v towards the camera  (1)
///     N <- N + (J^T W J)^-1 J^T W r,  r_k = i'_k - s_k - N . l_k,  J_k = l_k + ds_k / dN       (2)
///     p = share exp(-chi^2 / 2) / (share exp(-chi^2 / 2) + (1 - share) exp(-chi_1^2 / 2))      (3)
///
/// f is Cloth, Ggx or GgxAnisotropic of reflectance/specular.h with F0 = 0.04, and a its strength.
/// Each pixel under GgxAnisotropic takes the better of two tangents at a right angle: warp or weft.
/// Weights are 1 / variance of the luminance, (1) of solver/least_squares/weighted.h.
///
/// (3) is the probability that a pixel has the lobe. chi^2 is what (2) leaves of it, chi_1^2 what
/// rung 1 leaves, and `share` the share of the scene's pixels with the lobe. A pixel takes rung 3
/// where the lobe explains it and p >= 1/2.
///
/// Uncertainties are those of (4) of solver/least_squares/weighted.h with the covariance (J^T W
/// J)^-1. Half a degree is added in quadrature; to the albedo's as much, and a tenth of the lobe's
/// share.
///
/// Source   (1): Neubelt and Pettineo 2013, equation 23
namespace sateen {

// Normal of one pixel under a lobe, in double.
struct LobeAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();       // N of the body's luminance; zero: no answer
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();  // of the body
  double residual = 0.0;                             // RMS of the luminance
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double lobe_share = 0.0;  // reflection of the lobe over that of the body
  double misfit = 0.0;      // chi^2 over its degrees of freedom
};

// Usable samples of one pixel. The pixel counts as explained where its misfit is at most `limit`.
struct LobeSamples {
  // Computes `halves`.
  LobeSamples(Eigen::MatrixX3d directions, Eigen::MatrixX4d samples, Eigen::VectorXd by_variance,
              const Eigen::Vector3d& to_camera, double misfit_limit);

  Eigen::MatrixX3d l;       // directions to the lights
  Eigen::MatrixX4d i;       // i' of red, green, blue and luminance
  Eigen::VectorXd weights;  // 1 / variance of the luminance, s^2 included
  Eigen::Vector3d v;        // unit vector to the camera
  double limit;
  std::vector<LobeHalf> halves;  // one per light
};

// Returns the samples of a pixel of a stack. `limit` is that of MisfitLimits(), s^2 included.
[[nodiscard]] LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise,
                                        double scale_squared, const Eigen::Vector3d& v,
                                        double limit);

/// Solves (2) by Gauss-Newton with the analytic gradient of (1), whose steps are halved where they
/// would increase the misfit. It starts from least squares. Where that ends above the limit, it
/// also starts
///
///   * from least squares of the darker half of the samples, which contains no highlight, and
///   * from the normal that mirrors the brightest lights.
///
/// Cost   3 to 6 microseconds for ten samples, for yarns twice that
[[nodiscard]] LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe);

// Difference of a cloth from the lobe that it is given: of the angle in radians and of the albedo
// ...
inline constexpr double kLobeUncertainty = 0.00872664626;  // half a degree
// ... and of the lobe itself, relative.
inline constexpr double kUncertaintyOfLobe = 0.1;
// Fewest samples that can tell body from lobe.
inline constexpr int kFewestForLobe = 6;
// Smallest share of the pixels with the lobe, and without.
inline constexpr double kLeastShare = 0.01;

// Returns (3) from the chi^2 over its degrees of freedom without and with the lobe.
[[nodiscard]] double LobeProbability(double misfit_without, double misfit_with, int freedom,
                                     double share);

// Returns the unit vector from the table point of pixel (column, row) to the camera; nothing
// without a pose.
[[nodiscard]] std::optional<Eigen::Vector3d> ViewOf(const Rig& rig, int column, int row);

}  // namespace sateen
