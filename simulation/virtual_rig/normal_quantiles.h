#pragma once

#include <array>
#include <cstdint>
#include <memory>

namespace sateen {

// Normal deviates four at a time for a 64-bit random number: each of its 16-bit quarters chooses one
// of 65,536 equally probable values, the quantiles of the normal distribution, scaled to variance 1.
// Ten times as fast as NormalDeviate(), and no deviate is beyond 4.3.
class NormalQuantiles {
 public:
  static constexpr size_t kCount = 65536;

  // The same table for all; made when first asked for.
  static const NormalQuantiles& Table();

  [[nodiscard]] float operator[](uint64_t random) const { return values_[random & 0xFFFFU]; }

 private:
  NormalQuantiles();

  std::array<float, kCount> values_;
};

}  // namespace sateen
