#include "simulation/random.h"

#include <cmath>
#include <numbers>

namespace sateen {
namespace {

uint64_t Mix(uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

double UniformOf(uint64_t bits) { return (static_cast<double>(bits >> 11U) + 1.0) * 0x1p-53; }

}  // namespace

uint64_t HashOf(uint64_t seed, uint64_t counter) { return Mix(Mix(seed) ^ counter); }

double UniformDeviate(uint64_t seed, uint64_t counter) { return UniformOf(HashOf(seed, counter)); }

double NormalDeviate(uint64_t seed, uint64_t counter) {
  const uint64_t first = HashOf(seed, counter);
  return std::sqrt(-2.0 * std::log(UniformOf(first))) *
         std::cos(2.0 * std::numbers::pi * UniformOf(Mix(first)));
}

}  // namespace sateen
