#include "solver/noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sateen {
namespace {

// Returns the quantile of the normal distribution to some 1e-7: Abramowitz and Stegun 26.2.23 and a
// step of Newton's method.
double RoughNormalQuantile(double share) {
  if (share < 0.5) {
    return -RoughNormalQuantile(1.0 - share);
  }
  const double t = std::sqrt(-2.0 * std::log(1.0 - share));
  const double z = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                           (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  const double beyond = 0.5 * std::erfc(z / std::numbers::sqrt2);
  const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
  return z + (beyond - (1.0 - share)) / density;
}

}  // namespace

std::optional<StackNoise> NoiseOf(const LightStack& stack, const Rig& rig) {
  if (!rig.response || !rig.response->gain_dn_per_electron || !rig.response->read_noise_dn) {
    return std::nullopt;
  }
  const Response& response = *rig.response;
  const Eigen::Vector3d share = response.white_balance / response.white_balance.maxCoeff();
  StackNoise noise;
  for (const LightFrame& frame : stack) {
    if (!frame.raw || frame.merged || !std::isfinite(frame.full_scale)) {
      return std::nullopt;
    }
    const Eigen::Vector3d unit =
        share * static_cast<double>(frame.full_scale) / (response.white - response.black);
    SampleNoise of_frame;
    for (size_t c = 0; c < 3; ++c) {
      const double u = unit[static_cast<Eigen::Index>(c)];
      of_frame.shot[c] = *response.gain_dn_per_electron * u;  // (1)
      of_frame.read[c] = *response.read_noise_dn * u;
    }
    noise.push_back(of_frame);
  }
  return noise;
}

double ReducedChiSquaredQuantile(double share, int freedom) {
  if (freedom == 1) {
    return std::pow(RoughNormalQuantile(0.5 * (1.0 + share)), 2.0);
  }
  if (freedom == 2) {
    return -std::log(1.0 - share);
  }
  const double v = 2.0 / (9.0 * freedom);
  return std::pow(std::max(0.0, 1.0 - v + RoughNormalQuantile(share) * std::sqrt(v)), 3.0);
}

StackNoise UnknownNoise(size_t frames) { return StackNoise(frames); }

}  // namespace sateen
