#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "scanner/checks/light_patterns.h"
#include "scanner/sessions/block_means.h"

namespace sateen {

// Frames as block brightness, dark subtracted, with what the rig says of the light there.
struct FramesToShade {
  BlockGrid grid;
  std::vector<BlockField> signal;                   // [frame][block]
  std::vector<std::vector<Eigen::Vector3d>> light;  // e l, likewise; zero where not known
  std::vector<Eigen::Vector3d> view;                // [block]: unit vector to the camera
};

// A shade on one frame.
struct Shade {
  double share = 0.0;                                // share of the blocks
  double depth = 0.0;                                // share of the light that it takes, 0 to 1
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();  // place in the picture, 0 to 1 right and down
};

/// Blocks of one frame that are darker than all frames together say:
///
///     N_b = argmin sum_k |s_kb / e_kb - N . l_kb|,   y_kb = log s_kb - log (e_kb N_b . l_kb)   (1)
///     z_kb = y_kb - f(h_kb) - c_k - g_k . x_b                                                 (2)
///
/// The sum of absolute values in (1) lets one frame in ten lie. f, a cubic of the half vector
/// h = (l + v) / |l + v| common to all frames, is what a fabric does that is not Lambertian; c_k
/// and g_k . x_b, a plane over the picture that is held to the few per cent by which a ruler is
/// wrong (ridge), are what the rig does not know of a light. z is filtered by a 3 x 3 median. D_k
/// is the depth below the frame's upper quarter that `kFewest` neighbouring blocks exceed together;
/// a frame is shaded where
///
///     D_k > max(min_depth, kAbove median_j D_j)                                               (3)
///
/// so that what the model misses on this fabric is known from the other frames.
///
/// Returns  one for each frame, nothing where it is not shaded; empty where it cannot be told:
///          fewer than 6 frames, or lights in one plane
/// Cost     O(frames x blocks), about 5 ms for 10 frames of 384 blocks
/// Source   ours
[[nodiscard]] std::vector<std::optional<Shade>> FindShades(const FramesToShade& frames,
                                                           double min_depth);

// Returns the mean of |y| of (1): how badly these lights explain these frames. Infinite where it
// cannot be told.
[[nodiscard]] double MisfitOfLights(const FramesToShade& frames);

}  // namespace sateen
