#pragma once

#include <cstdint>

namespace sateen {

// Numbers that depend on a seed and a counter alone, so that what is drawn for a sample is the
// same in whatever order, and on however many threads, the samples are drawn.

// Mixes the bits by SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
// generators", 2014).
[[nodiscard]] inline uint64_t MixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}
[[nodiscard]] uint64_t HashOf(uint64_t seed, uint64_t counter);

// Returns a number uniform in (0, 1].
[[nodiscard]] double UniformDeviate(uint64_t seed, uint64_t counter);

// Returns a normal number with mean 0 and variance 1 (Box and Muller, 1958).
[[nodiscard]] double NormalDeviate(uint64_t seed, uint64_t counter);

}  // namespace sateen
