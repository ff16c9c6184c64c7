#pragma once

#include <array>
#include <optional>
#include <vector>

#include "imaging/light_stack.h"
#include "rig/rig.h"

namespace sateen {

// Noise of the samples of one frame: radiance i of channel c has the variance shot[c] i +
// read[c]^2.
struct SampleNoise {
  std::array<double, 3> shot = {1.0, 1.0, 1.0};
  std::array<double, 3> read = {0.0, 0.0, 0.0};
};

// One entry per frame of a stack.
using StackNoise = std::vector<SampleNoise>;

// Smallest n . l at which the noise of a sample is computed. Unknown noise has no read noise,
// without which a grazing sample would have all the weight.
inline constexpr float kLeastCosine = 0.02F;

/// Returns the noise of a stack from the rig's response. With the radiance of one DN of channel c
/// and white balance w, u_c = w_c full_scale / (max w (white - black)):
///
///     shot_c = gain u_c,   read_c = read_noise u_c                                        (1)
///
/// Returns nothing where
///
///   * the rig has no gain or read noise,
///   * a frame has no full scale,
///   * a frame is not camera RAW, which the rig's response does not describe, or
///   * a frame is merged from several exposures, for which (1) would give the noise of the
///     shortest.
///
/// Demosaicing averages sites, so pixels have less noise than this; the ladder measures by how
/// much.
[[nodiscard]] std::optional<StackNoise> NoiseOf(const LightStack& stack, const Rig& rig);

// Returns shot noise of unknown gain: right up to one factor, which the ladder measures.
[[nodiscard]] StackNoise UnknownNoise(size_t frames);

// Returns the `share` quantile of chi^2 over its degrees of freedom: for one and two in closed
// form, beyond by Wilson and Hilferty's cube root, within 7 % for shares of 0.05 and more.
[[nodiscard]] double ReducedChiSquaredQuantile(double share, int freedom);

}  // namespace sateen
