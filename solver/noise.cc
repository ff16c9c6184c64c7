#include "solver/noise.h"

#include <cmath>

namespace sateen {

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

StackNoise UnknownNoise(size_t frames) { return StackNoise(frames); }

}  // namespace sateen
