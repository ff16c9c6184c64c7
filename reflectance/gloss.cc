#include "reflectance/gloss.h"

#include <cmath>

namespace sateen {

double AlphaFromGloss(double gloss) { return std::sqrt(2.0 / (1.0 + std::exp2(18.0 * gloss))); }

double GlossFromAlpha(double alpha) { return std::log2(2.0 / (alpha * alpha) - 1.0) / 18.0; }

double AlphaFromOldGloss(double gloss) { return std::sqrt(2.0 / (2.0 + std::exp2(16.0 * gloss))); }

double OldGlossFromAlpha(double alpha) { return std::log2(2.0 / (alpha * alpha) - 2.0) / 16.0; }

double SpecularPowerFromGloss(double gloss) { return std::exp2(10.0 * gloss + 1.0); }

double GlossFromSpecularPower(double power) { return (std::log2(power) - 1.0) / 10.0; }

double AlphaFromSpecularPower(double power) { return std::sqrt(2.0 / (power + 2.0)); }

double SpecularPowerFromAlpha(double alpha) { return 2.0 / (alpha * alpha) - 2.0; }

double AlphaFromGltfRoughness(double roughness) { return roughness * roughness; }

double GltfRoughnessFromAlpha(double alpha) { return std::sqrt(alpha); }

}  // namespace sateen
