#pragma once

#include <array>
#include <optional>
#include <vector>

#include "solver/least_squares/least_squares.h"
#include "solver/lobe/lobe.h"
#include "solver/noise.h"

namespace sateen {

// Equation (15) over these pixels, and which share of them has the lobe. Nothing where they are fewer
// than 64; where no lobe explains 70 of 100, halves what least squares leave unexplained and takes a
// fifth off (15); or where the best is beyond what cloth has: a strength of 0.15 to 3, a roughness up
// to 0.7, of fuzz 0.85. Stray light and bounces look like a rougher and stronger lobe.
[[nodiscard]] std::optional<Lobe> SearchLobe(const std::vector<LobeSamples>& pixels, int threads);

// Pixels that SearchLobe() is to be given, and the share that rung 1 has to explain so that no lobe is looked
// for.
inline constexpr size_t kLobePixels = 384;
inline constexpr double kWellExplained = 0.8;

// The lobe that explains a sample of pixels of which plain least squares leave many unexplained;
// nothing where none does, or where there is no camera to say from where the surface is seen. A pixel
// is explained where its misfit is at most limit[its usable samples].
[[nodiscard]] std::optional<Lobe> FindLobe(const LightStack& stack, const Rig& rig,
                                           const LambertianOptions& options,
                                           const StackNoise& noise, double scale_squared,
                                           const MisfitSample& sample,
                                           const std::array<float, 256>& limit, int threads);

}  // namespace sateen
