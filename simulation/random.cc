#include "simulation/random.h"

#include <cmath>
#include <numbers>

namespace sateen {
namespace {

double UniformOf(uint64_t bits) { return (static_cast<double>(bits >> 11U) + 1.0) * 0x1p-53; }

}  // namespace

uint64_t HashOf(uint64_t seed, uint64_t counter) { return MixBits(MixBits(seed) ^ counter); }

double UniformDeviate(uint64_t seed, uint64_t counter) { return UniformOf(HashOf(seed, counter)); }

double NormalDeviate(uint64_t seed, uint64_t counter) {
  const uint64_t first = HashOf(seed, counter);
  return std::sqrt(-2.0 * std::log(UniformOf(first))) *
         std::cos(2.0 * std::numbers::pi * UniformOf(MixBits(first)));
}

}  // namespace sateen
