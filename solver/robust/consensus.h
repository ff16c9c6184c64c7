#pragma once

#include <Eigen/Core>

#include "solver/least_squares/pixel_system.h"

/// Rung 2 of solver/ladder.h: the normal that most samples of a pixel agree with.
///
/// With the sum a_c of i'_kc over the usable samples and its departure from grey
/// d_c = a_c - (a_r + a_g + a_b) / 3:
///
///     j_k = sum_c w_c i'_kc,  w_c = y d_c / |d|^2,  y = luminance of a                        (1)
///     band = j_k > 0.4 q, q = median of the usable j_k; beyond 10 samples without the darkest
///            34 % and the brightest 50 %                                                     (2)
///     N_abc . l_k = j_k for k = a, b, c:  every triple of the band, or of
///            10 evenly spaced ranks of it                                                    (3)
///     N = the N_abc with the least prod_k (1 + |j_k - N_abc . l_k| / (0.03 q))                (4)
///     twice: N = argmin sum_k w_k (j_k - N . l_k)^2, w_k = (1 + (r_k / (0.1 q))^2)^-2         (5)
///     spread = hypot(3 degrees, 4 sqrt((tr C - n.C n) S) / |N|),
///     C = (sum_k w_k l_k l_k^T)^-1, S = sum_k w_k r_k^2 / max(1, sum_k w_k - 3)               (6)
///     uncertainty = (2 - agreeing / usable) hypot(spread, 0.4 t), t = angle to rung 1's n     (7)
///
/// (1) holds where |d| > 0.2 |a| and where (4) is below a tenth of its value without; elsewhere j_k
/// = i'_k. Highlights of white lights on anything but metal are white, so they have no part in a
/// coloured cloth's departure from grey.
///
/// (4) is a sum of logarithms: it prefers a normal that many samples agree with exactly, whatever
/// the others do. Highlights and shadows need that.
///
/// The albedo's uncertainty replaces, in (6), tr C - n.C n by n.C n and 3 degrees by 0.05, and in
/// (7) t by the relative difference of the albedo's luminance from rung 1's. Then 0.05 / albedo is
/// added in quadrature, because rough gloss reaches all samples alike.
///
/// A pixel in which fewer than four samples agree with N to 0.1 q is kUnexplained and three times
/// as uncertain. Where no N is left, it is at least 60 degrees uncertain.
///
/// Cost     O(K^2 + K 10^3) per pixel
/// Source   the search over triples is exhaustive RANSAC (Fischler and Bolles 1981) with the cost
///          of sparse regression (log-sum: Candes, Wakin and Boyd 2008); (2) is position
///          thresholding (Shi et al. 2014, section 3); (1) is the specular-free subspace of
///          Mallick, Zickler, Kriegman and Belhumeur 2005
namespace sateen {

// Constants of the equations, shared by the plain form and the kernel. They were found on the
// DiLiGenT ball, the rendered bunny and random choices of their lights; docs/decisions.md has the
// figures.

// (1): smallest |d| / |a| of a pixel that may be solved on its departure from grey.
inline constexpr float kLeastChroma = 0.2F;
// (1): largest product of (4), relative to the luminance's, at which the departure from grey is
// taken. The departure is noisier.
inline constexpr float kChromaAdvantage = 0.1F;
// (2): lower end of the band, in medians. In the penumbra, at the terminator and between fibres the
// model is at its worst.
inline constexpr float kDarkOfMedian = 0.4F;
// (2): number of samples that are not trimmed, and shares of the rest that are.
inline constexpr int kUntrimmedSamples = 10;
inline constexpr float kTrimDark = 0.34F;
inline constexpr float kTrimBright = 0.5F;
// (3): most samples that triples are made of.
inline constexpr int kTripleSamples = 10;
// (3): smallest |l_a x l_b . l_c| of a triple that counts.
inline constexpr float kLeastTripleVolume = 0.05F;
// (4): scale of a misfit, in medians.
inline constexpr float kConsensusScale = 0.03F;
// (5): steps, and tuning constant in medians.
inline constexpr int kReweightings = 2;
inline constexpr float kReweightScale = 0.1F;
// Largest residual of a sample that agrees, in medians.
inline constexpr float kAgreeing = 0.1F;
// Fewest samples whose agreement counts: any three agree.
inline constexpr int kFewestAgreeing = 4;
// (6): factor on the spread of the samples, which shows the model's error only in part, and floor.
inline constexpr float kUncertaintyFactor = 4.0F;
inline constexpr float kLeastModelUncertainty = 0.0523598776F;  // 3 degrees
// (7): share of the difference between two rungs that counts as doubt about the better one.
inline constexpr float kUncertaintyOfTurn = 0.4F;
// Albedo that rough gloss of a dielectric may add to all samples alike: 4 % of the light, some
// lobe.
inline constexpr double kGlossInAlbedo = 0.05;

// Rung 2 for one pixel, before (7).
struct ConsensusAnswer {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // N of the luminance; zero: no answer
  Eigen::Array3d albedo = Eigen::Array3d::Zero();
  double residual = 0.0;
  double uncertainty_deg = 0.0;
  double albedo_uncertainty = 0.0;
  int agreeing = 0;
};

// Solves (1) to (6) for one pixel in double: the plain form that the fast kernel is tested against,
// and the solver of the pixels that the kernel refuses. No answer where the condition number of the
// lights in (5) is above max_condition.
[[nodiscard]] ConsensusAnswer PlainConsensus(const PixelSystem& system, double max_condition);

}  // namespace sateen
