#pragma once

#include <array>
#include <cstdint>
#include <memory>

namespace sateen {

// Normal deviates, four for a random number of 64 bits: each 16 of them choose one of 65,536
// equally probable values, the quantiles of the normal distribution, scaled to variance 1. None is
// beyond 4.4. NormalDeviate() has no such end, and costs a logarithm and a cosine each.
class NormalQuantiles {
 public:
  static constexpr size_t kCount = 65536;

  // Returns the same table for all; it is made when first asked for.
  static const NormalQuantiles& Table();

  [[nodiscard]] float operator[](uint64_t random) const { return values_[random & 0xFFFFU]; }

 private:
  NormalQuantiles();

  std::array<float, kCount> values_;
};

}  // namespace sateen
