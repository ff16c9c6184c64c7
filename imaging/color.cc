#include "imaging/color.h"

#include <cmath>

namespace sateen {
namespace {

// The two pieces meet here (IEC 61966-2-1, 5.2 and 5.3).
constexpr double kEncodedKnee = 0.04045;
constexpr double kLinearKnee = 0.0031308;

}  // namespace

float LinearFromSrgb(float encoded) {
  const double v = std::abs(static_cast<double>(encoded));
  const double linear = v <= kEncodedKnee ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return std::copysign(static_cast<float>(linear), encoded);
}

float SrgbFromLinear(float linear) {
  const double v = std::abs(static_cast<double>(linear));
  const double encoded = v <= kLinearKnee ? v * 12.92 : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055;
  return std::copysign(static_cast<float>(encoded), linear);
}

}  // namespace sateen
