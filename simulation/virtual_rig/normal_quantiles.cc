#include "simulation/virtual_rig/normal_quantiles.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace sateen {
namespace {

// Returns the z above 0 beyond which the share `p` of the normal distribution lies, by Newton's
// method from a z that is a little too small.
double UpperQuantile(double p, double z) {
  for (int step = 0; step < 50; ++step) {
    const double above = 0.5 * std::erfc(z / std::numbers::sqrt2);
    const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
    const double change = (above - p) / density;
    z += change;
    if (std::abs(change) < 1e-12) {
      break;
    }
  }
  return z;
}

}  // namespace

const NormalQuantiles& NormalQuantiles::Table() {
  static const std::unique_ptr<const NormalQuantiles> kTable(new NormalQuantiles());
  return *kTable;
}

NormalQuantiles::NormalQuantiles() : values_() {
  constexpr size_t kHalf = kCount / 2;
  std::vector<double> upper(kHalf);
  double squares = 0.0;
  double z = 0.0;
  for (size_t i = 0; i < kHalf; ++i) {
    const double p = 0.5 - (static_cast<double>(i) + 0.5) / static_cast<double>(kCount);
    z = UpperQuantile(p, z);
    upper[i] = z;
    squares += z * z;
  }
  const double scale = 1.0 / std::sqrt(squares / static_cast<double>(kHalf));
  for (size_t i = 0; i < kHalf; ++i) {
    values_[kHalf + i] = static_cast<float>(scale * upper[i]);
    values_[kHalf - 1 - i] = -values_[kHalf + i];
  }
}

}  // namespace sateen
