#pragma once

#include <array>
#include <optional>
#include <vector>

#include "solver/least_squares/least_squares.h"
#include "solver/lobe/lobe.h"
#include "solver/noise.h"

/// Search for the lobe of a scene, by the misfits of some 400 pixels under it:
///
///     a, alpha = argmin sum over the pixels of min(log(1 + misfit / limit), 20)               (1)
///
/// over fuzz and gloss, and over gloss of yarns where neither of them is believed. A lobe is
/// believed where all of this holds:
///
///   * it explains 70 % of the pixels;
///   * it halves the number of pixels that least squares leave unexplained;
///   * it reduces (1) by a fifth;
///   * cloth can have it: a strength of 0.15 to 3, a roughness up to 0.7, for fuzz up to 0.85.
///     Stray light and interreflection look like a rougher and stronger lobe.
namespace sateen {

// Number of pixels to give to SearchLobe().
inline constexpr size_t kLobePixels = 384;
// Share of pixels explained by rung 1 from which no lobe is looked for.
inline constexpr double kWellExplained = 0.8;

// Minimises (1) over these pixels and measures the share of them with the lobe. Returns nothing
// where no lobe is believed, or for fewer than 64 pixels. Takes 0.1 to 3 s.
[[nodiscard]] std::optional<Lobe> SearchLobe(const std::vector<LobeSamples>& pixels, int threads);

// Searches the sampled pixels, where rung 1 explains too few of them. `limit` holds the largest
// misfit of an explained pixel, by its usable samples. Returns nothing without a camera that tells
// from where the surface is seen.
[[nodiscard]] std::optional<Lobe> FindLobe(const FramesInput& input,
                                           const LambertianOptions& options,
                                           const StackNoise& noise, double scale_squared,
                                           const MisfitSample& sample,
                                           const std::array<float, 256>& limit, int threads);

}  // namespace sateen
