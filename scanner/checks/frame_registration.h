#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <limits>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// How far a picture lies from another one, right and down, and the standard deviation of that.
struct Shift {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sd_px = std::numeric_limits<double>::infinity();
};

// Returns whether the shift is beyond 3 standard deviations and 0.05 px, and so worth correcting.
[[nodiscard]] bool IsSignificant(const Shift& shift);

// Frames to be laid over each other: pictures of one size in cells of 2 x 2 px.
struct FramesToRegister {
  std::vector<Image<float>> frames;  // not finite where saturated
  // e_k l_k of frame k at a place in cells; zero where not known. Rough is good enough.
  std::function<Eigen::Vector3d(std::size_t k, const Eigen::Vector2d& cell)> light;
};

/// Finds how each frame lies against the first, though each is lit from elsewhere. Within a tile of
/// 8 x 8 cells a Lambertian surface N = rho n, moved by d_k, gives
///
///     v_k(x) = i_k(x) / e_k = N(x) . (l_k + a_k) - grad v_k(x) . d_k                        (1)
///
/// P = I - L (L^T L)^-1 L^T takes N . l_k out whatever N is, as K > 3. What is left is linear in
/// the shifts d_k and in a_k, by which the light differs from what the rig says (ridge of 0.3):
///
///     min over d, a of  sum_x w(x) |P (v + G d - N' a)|^2,  d_1 = 0,  N' = v L (L^T L)^-1   (2)
///     w = (1 + r^2 / s^2)^-2,  r = |P v| / mean i,  s = 2 median r                          (3)
///
/// v is taken less its mean over 9 x 9 cells: at an edge, an error of the light that varies over
/// the picture then has nothing in common with the gradient.
///
/// Gauss-Newton: solve (2), resample the frames by the new d (LanczosAt()), again; from a picture
/// of 1/8 of the size to the full one. (3) leaves cast shadows and highlights aside. The last frame
/// is the first light again, so that ShiftBetween() gives a second start: all frames from some k on
/// have moved by that. The end with the smaller sum of r counts. The covariance is
/// A^-1 (sum of b b^T over tiles) A^-1, A and b being the normal equations of (2): it knows what
/// the model misses, not only noise.
///
/// The highlights of a glossy yarn wander with the light, all frames alike, and a nudge is a jump
/// between two frames: what the jumps between frames have in common with those of the light is
/// taken out (TakeOutGloss).
///
/// Returns  one for each frame; the first is zero. sd_px is infinite where nothing can be told:
///          first and last frame correlate by less than `min_peak`, or less than that share of the
///          frames' variance is a surface's, so that there is more noise than texture; fewer than 5
///          frames; fewer than 32 x 32 cells; lights in one plane
/// Cost     about 26 ms a frame of 512 x 512 cells on one thread, 140 ms where they have moved by
///          pixels; the same bits every time
/// Source   four and more lights are linearly dependent whatever the surface: Barsky and Petrou,
///          "The 4-source photometric stereo technique", PAMI 25(10), 2003; frames laid over each
///          other by what photometric stereo predicts of them: Joshi and Kriegman, "Shape from
///          varying illumination and viewpoint", ICCV 2007. To solve all shifts and the lights'
///          errors together in the null space, without normals, is ours.
[[nodiscard]] std::vector<Shift> RegisterFrames(const FramesToRegister& input, double min_peak);

}  // namespace sateen
