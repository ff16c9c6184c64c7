#pragma once

#include <cstdint>

namespace sateen {

// Numbers that depend on a seed and a counter alone, so that what is drawn for a sample is the
// same in whatever order, and on however many threads, the samples are drawn.

// SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
[[nodiscard]] uint64_t HashOf(uint64_t seed, uint64_t counter);

// Uniform in (0, 1].
[[nodiscard]] double UniformDeviate(uint64_t seed, uint64_t counter);

// Normal with mean 0 and variance 1 (Box and Muller, 1958).
[[nodiscard]] double NormalDeviate(uint64_t seed, uint64_t counter);

}  // namespace sateen
