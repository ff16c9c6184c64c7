#pragma once

namespace sateen {

// Scales of roughness, and what each calls the alpha of a microfacet distribution (microfacet.h).
//
// Neubelt and Pettineo (2013) store alpha itself under the name roughness. Gloss runs from 0,
// rough, to 1, smooth. None of these functions clamps: outside the domain the result is out of
// range.

/// alpha = sqrt(2 / (1 + 2^(18 g)))                        g in [0, 1]; alpha in [0.00276213, 1]
/// Source: Chan 2018, eq. 2 (Call of Duty: WWII); 1-01
[[nodiscard]] double AlphaFromGloss(double gloss);

/// g = log2(2 / alpha^2 - 1) / 18
[[nodiscard]] double GlossFromAlpha(double alpha);

/// alpha = sqrt(2 / (2 + 2^(16 g)))                   g in [0, 1]; alpha in [0.00552, 0.816497]
/// Source: Chan 2018, eq. 1 (Call of Duty: Advanced Warfare); 1-01
[[nodiscard]] double AlphaFromOldGloss(double gloss);

/// g = log2(2 / alpha^2 - 2) / 16
[[nodiscard]] double OldGlossFromAlpha(double alpha);

/// n = 2^(10 g + 1)                                                  g in [0, 1]; n in [2, 2048]
/// Source: Lagarde 2011; 2-05
[[nodiscard]] double SpecularPowerFromGloss(double gloss);

/// g = (log2(n) - 1) / 10
[[nodiscard]] double GlossFromSpecularPower(double power);

/// alpha^2 = 2 / (n + 2): the power n of a Blinn-Phong lobe as wide as a lobe of this alpha
/// n in [0, infinity); alpha in (0, 1]
/// Source: Walter et al. 2007
[[nodiscard]] double AlphaFromSpecularPower(double power);

/// n = 2 / alpha^2 - 2
[[nodiscard]] double SpecularPowerFromAlpha(double alpha);

/// The roughness r of glTF 2.0, OpenPBR, U3M and Unreal: alpha = r^2                both in [0, 1]
[[nodiscard]] double AlphaFromGltfRoughness(double roughness);

/// r = sqrt(alpha)
[[nodiscard]] double GltfRoughnessFromAlpha(double alpha);

}  // namespace sateen
