#pragma once

#include <optional>
#include <string_view>

#include "solver/lambertian.h"
#include "solver/noise.h"

namespace sateen {

enum class LadderMode {
  kAuto,          // each pixel takes the lowest rung that explains its samples
  kLeastSquares,  // rung 1 on every pixel
  kConsensus      // rung 2 on every pixel of more than three samples
};

// "auto", "least-squares", "robust".
[[nodiscard]] std::string_view Name(LadderMode mode);
[[nodiscard]] std::optional<LadderMode> LadderModeNamed(std::string_view name);

struct LadderOptions {
  LadderMode mode = LadderMode::kAuto;
  LambertianOptions least_squares;
  // Noise of each frame; nothing: shot noise of a gain that is measured on the residuals.
  std::optional<StackNoise> noise;
  // A pixel climbs where noise alone would give its residual less often than this. In (0, 0.5).
  double false_alarms = 3e-4;
  // ... and where the residual is above this fraction of the albedo, which no calibration explains
  // better. [0, 1).
  double explained_residual = 0.002;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Surface normal, albedo and uncertainty per pixel, by the lowest rung that explains the samples.
///
/// Rung 1, least squares with the samples' noise for weights. N^0 is SolveLambertian's, f_kc = 1 / e_kc,
/// and SampleNoise gives shot and read noise; sums over k are over usable samples:
///
///     var_kc = f_kc (shot_c b_c max(N^0 . l_k, 0.02 |N^0|) + f_kc read_c^2)                   (1)
///     b_c = max(0, sum_k i'_kc) / sum_k i'_k                                                 (2)
///     m_k = sum_c u_c i'_kc,  u_c = (b_c / v_c) / sum_c (b_c^2 / v_c), v_c = (1) of the first
///     light on a pixel that faces it, at least a millionth of the three                      (3)
///     N = argmin sum_k W_k (m_k - N . l_k)^2,  W_k = 1 / sum_c u_c^2 var_kc,  rho_c = b_c |N|,
///     uncertainty = s sqrt(tr C - n.C n) / |N|,  C = (sum_k W_k l_k l_k^T)^-1,
///     that of the albedo's luminance = s sqrt(n.C n + (R - 1) / (n.C^-1 n)) / |N|,
///     R = sum_c y_c^2 v_c / sum_c u_c^2 v_c, y_c: 0.2126, 0.7152, 0.0722                      (4)
///     misfit = sum_k W_k (m_k - N . l_k)^2 / (usable - 3)                                    (5)
///
/// Variances come from what least squares predict, not from the samples: weights taken from noisy
/// samples would draw N towards the dark. `uncertainty` is the root mean square angle, in degrees,
/// between n and the truth; 95 of 100 angles are below 1.96 times that (1.73 where it is the same in
/// all directions). That of the albedo is a share of it; R, because each rho_c is known from its own
/// channel alone. s^2 is the 25th percentile (5th where the noise is unknown) of the misfits of some
/// 4,000 pixels over that of chi^2: at most 1 where the noise is known, because demosaicing only takes
/// noise away; at most what neighbouring pixels differ by where it is not, because a shiny scene
/// misfits everywhere. Never below what rounding of the samples leaves, which in smooth frames may be
/// all there is. Where the noise is unknown and no pixel has more than three samples, s^2 is what
/// neighbours differ by; where they tell nothing either, uncertainty = 180 and that of the albedo 1: unknown.
///
/// Rung 2, consensus, where misfit / s^2 is above the (1 - false_alarms) quantile of chi^2 and the
/// residual above explained_residual |N|. With the sum a_c of i'_kc over the usable samples and its
/// departure from grey d_c = a_c - (a_r + a_g + a_b) / 3:
///
///     j_k = sum_c w_c i'_kc,  w_c = y d_c / |d|^2 where |d| > 0.2 |a|, y = luminance of a;
///     else, and where (9) is not below a tenth of what it is without, j_k = i'_k               (6)
///     band = j_k > 0.4 q, q = median of the usable j_k; beyond 10 samples without the darkest
///     34 and brightest 50 of 100                                                             (7)
///     N_abc . l_k = j_k for k = a, b, c:  every triple of the band (of 10 evenly spaced ranks)  (8)
///     N = the N_abc of least prod_k (1 + |j_k - N_abc . l_k| / (0.03 q))                       (9)
///     twice: N = argmin sum_k w_k (j_k - N . l_k)^2, w_k = (1 + (r_k / (0.1 q))^2)^-2          (10)
///     spread = hypot(3 degrees, 4 sqrt((tr C - n.C n) S) / |N|),
///     C = (sum_k w_k l_k l_k^T)^-1, S = sum_k w_k r_k^2 / max(1, sum_k w_k - 3)               (11)
///     uncertainty = (2 - agreeing / usable) hypot(spread, 0.4 t), t = angle to rung 1's n      (12)
///
/// and of the albedo the same with n.C n in (11), 3 degrees as 0.05, and for t the share by which the albedo's
/// luminance differs from rung 1's; and 0.05 over it, because gloss that is rough reaches all samples alike.
///
/// (6): the highlights of white lights on what is not metal are white, and a coloured cloth's
/// departure from grey has no part in them.
/// (9) is the sum of logarithms: it prefers a normal that many samples agree with exactly, whatever
/// the others do, which is what highlights and shadows need. A pixel in which fewer than four
/// samples agree with N to 0.1 q is kUnexplained and three times as uncertain, at least 60 degrees where
/// no N is left; one with three usable samples, which nothing can
/// check, is kUnchecked. Where from 2 to 20 of 100 pixels take this rung, rung 1's uncertainty gets 0 to
/// all of hypot(3 degrees, 0.4 t), t in the mean of those pixels; kUnchecked all of t.
///
/// Rung 3, a lobe that the scene has in common, where the rig has a camera, at kAuto:
///
///     i'_k = N . l_k + s_k(n),  s_k = a pi f(n, l_k, v) max(0, n . l_k), v towards the camera   (13)
///     N <- N + (J^T W J)^-1 J^T W r,  r_k = i'_k - s_k - N . l_k,  J_k = l_k + ds_k / dN        (14)
///     a, alpha = argmin sum over some 400 pixels of min(log(1 + misfit / limit), 20)         (15)
///
/// f is Cloth, Ggx or GgxAnisotropic of reflectance/specular.h with F0 = 0.04; of the last, which is
/// tried where no other does, every pixel takes the better of two tangents at a right angle: warp or
/// weft. It is looked for where rung 1 explains fewer than 80 of 100 pixels, and believed where (14)
/// explains 70, halves what is unexplained and takes a fifth off (15) (solver/lobe/lobe_search.h). A pixel that
/// it explains takes it where
///
///     share exp(-chi^2 / 2) > (1 - share) exp(-chi_1^2 / 2)                                   (17)
///
/// chi_1^2 rung 1's, `share` that of the pixels with the lobe. Uncertainties are (4) with the covariance
/// (J^T W J)^-1, half a degree, and of the albedo a tenth of what the lobe reflects over it; what the two
/// answers differ by, times the root of the probability of the other, is part of both rungs'. So is what
/// uncertain lights do (solver/light_doubt.h).
///
/// Where all frames are camera RAW, their colours are interpolated, and no rung sees what that does to
/// the normals where they bend from pixel to pixel:
///
///     uncertainty <- hypot(uncertainty, b / 2),  b^2 = |n(x-1) - 2 n + n(x+1)|^2 + the same in y  (16)
///
/// and of the albedo the same with its luminance over that of the pixel for n.
///
/// stack, rig, mask, errors   as SolveLambertian
/// Cost     rung 1 1.4 times SolveLambertian; rung 2 O(K^2 + K 10^3) a pixel; rung 3 some
///          microseconds a pixel and 0.1 to 1 s to find; the same bits for any number of threads
/// Source   the search over triples is exhaustive RANSAC (Fischler and Bolles 1981) with the cost of
///          sparse regression (log-sum: Candes, Wakin and Boyd 2008); the band is position
///          thresholding (Shi et al. 2014, section 3);
///          (6) is the specular-free subspace of Mallick, Zickler, Kriegman and Belhumeur 2005;
///          (13): Neubelt and Pettineo 2013, equation 23
[[nodiscard]] Result<NormalField> SolveLadder(const LightStack& stack, const Rig& rig,
                                              const std::optional<Mask>& mask,
                                              const LadderOptions& options = {},
                                              const Task& task = {});

// The same into a field that may hold an earlier result, as SolveLambertianInto.
[[nodiscard]] Status SolveLadderInto(const LightStack& stack, const Rig& rig,
                                     const std::optional<Mask>& mask, const LadderOptions& options,
                                     const Task& task, NormalField& field);

}  // namespace sateen
