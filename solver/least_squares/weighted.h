#pragma once

#include <Eigen/Core>
#include <span>

#include "solver/lambertian.h"
#include "solver/least_squares/pixel_system.h"
#include "solver/noise.h"

/// Rung 1 of solver/ladder.h: least squares, weighted by the noise of the samples.
///
/// N^0 is the N of SolveLambertian(), f_kc = 1 / e_kc, and SampleNoise gives shot and read noise.
/// Sums over k run over the usable samples:
///
///     var_kc = f_kc (shot_c b_c max(N^0 . l_k, 0.02 |N^0|) + f_kc read_c^2)                   (1)
///     b_c = max(0, sum_k i'_kc) / sum_k i'_k                                                 (2)
///     m_k = sum_c u_c i'_kc,  u_c = (b_c / v_c) / sum_c (b_c^2 / v_c)                         (3)
///     N = argmin sum_k W_k (m_k - N . l_k)^2,  W_k = 1 / sum_c u_c^2 var_kc,  rho_c = b_c |N|,
///     uncertainty = s sqrt(tr C - n.C n) / |N|,  C = (sum_k W_k l_k l_k^T)^-1,
///     albedo_uncertainty = s sqrt(n.C n + (R - 1) / (n.C^-1 n)) / |N|,
///     R = sum_c y_c^2 v_c / sum_c u_c^2 v_c,  y = (0.2126, 0.7152, 0.0722)                    (4)
///     misfit = sum_k W_k (m_k - N . l_k)^2 / (usable - 3)                                    (5)
///
/// v_c is (1) for the first light on a pixel that faces it, and at least a millionth of the sum of
/// the three. s is that of solver/robust/noise_scale.h.
///
/// Variances come from the prediction of least squares, not from the samples: weights taken from
/// noisy samples would pull N towards the dark. `uncertainty` is the root mean square angle between
/// n and the truth, in degrees. 95 % of the angles are below 1.96 times that, or below 1.73 times
/// where the uncertainty is the same in all directions. `albedo_uncertainty` is relative; R stands
/// in it because each rho_c is known from its own channel alone.
namespace sateen {

// Variances of a solution N with covariance C.
struct NormalVariances {
  double angular;  // of its direction n, in radians squared: (tr C - n.C n) / |N|^2
  double albedo;   // of its length, relative: n.C n / |N|^2
};
[[nodiscard]] NormalVariances VariancesOf(const Eigen::Matrix3d& covariance,
                                          const Eigen::Vector3d& n);

// Rung 1 for one pixel.
struct WeightedAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // N of the luminance; zero: no answer
  Eigen::Array3d albedo = Eigen::Array3d::Zero();
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  double misfit = 0.0;
};

// Solves (1) to (5) with s = 1 for one pixel in double: the plain form that the fast kernel is
// tested against, and the solver of the pixels that the kernel refuses.
[[nodiscard]] WeightedAnswer PlainWeighted(const PixelSystem& system, const StackNoise& noise);

// Marks the pixels of this reason in `misfits`, which has one entry per pixel of the rows, for
// WeighRowsInDouble().
void MarkPending(Reason which, int row_begin, int row_end, const NormalField& field,
                 std::span<float> misfits);
// Solves the marked pixels that are solved by now with PlainWeighted(); multiplies their
// uncertainties by noise_scale.
void WeighRowsInDouble(const FramesInput& input, const LambertianOptions& options,
                       const StackNoise& noise, double noise_scale, int row_begin, int row_end,
                       NormalField& field, std::span<float> misfits);

}  // namespace sateen
