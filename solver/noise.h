#pragma once

#include <array>
#include <optional>
#include <vector>

#include "imaging/light_stack.h"
#include "rig/rig.h"

namespace sateen {

// Noise of one frame's samples: of radiance i of channel c, variance = shot[c] i + read[c]^2.
struct SampleNoise {
  std::array<double, 3> shot = {1.0, 1.0, 1.0};
  std::array<double, 3> read = {0.0, 0.0, 0.0};
};

// One for each frame of a stack.
using StackNoise = std::vector<SampleNoise>;

// Below this n . l the noise of a sample counts as what it is here: an unknown light has no read
// noise, and without it a grazing sample would have all the weight.
inline constexpr float kLeastCosine = 0.02F;

/// From the response of the rig: with u_c = w_c full_scale / (max w (white - black)), the radiance
/// of one DN of channel c and white balance w,
///
///     shot_c = gain u_c,   read_c = read_noise u_c                                        (1)
///
/// Nothing where the rig has no gain or read noise, or a frame no full scale; nor where a frame is not
/// camera RAW, which the rig's figures say nothing about, or merged from several exposures, whose
/// noise (1) would give as that of the shortest one. Demosaicing averages sites, so that pixels have
/// less noise than this; the ladder measures by how much.
[[nodiscard]] std::optional<StackNoise> NoiseOf(const LightStack& stack, const Rig& rig);

// Shot noise of unknown gain: right but for one factor, which the ladder measures.
[[nodiscard]] StackNoise UnknownNoise(size_t frames);

// The `share` quantile of at least one value, which are put into another order.
[[nodiscard]] float QuantileOf(std::vector<float>& values, double share);

// The `share` quantile of chi^2 over its degrees of freedom: of one and two in closed form, beyond
// by Wilson and Hilferty's cube root, within 7 % for shares of 0.05 and more.
[[nodiscard]] double ReducedChiSquaredQuantile(double share, int freedom);

}  // namespace sateen
