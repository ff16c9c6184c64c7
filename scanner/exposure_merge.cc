#include "scanner/exposure_merge.h"

#include <algorithm>

namespace sateen {

double ReadingNoise::Weight(double radiance, double exposure) const {
  if (floor <= 0.0) {
    return exposure;
  }
  return exposure * exposure / (per_reading * std::max(radiance, 0.0) * exposure + floor);
}

ReadingNoise NoiseOf(const RawMosaic& mosaic, const Response* response) {
  if (response == nullptr || !response->gain_dn_per_electron || !response->read_noise_dn) {
    return {};
  }
  constexpr double kRounding = 1.0 / 12.0;
  const double range = static_cast<double>(mosaic.white) - static_cast<double>(mosaic.black);
  const double r = *response->read_noise_dn;
  return {.per_reading = *response->gain_dn_per_electron / range,
          .floor = (r * r + kRounding) / (range * range)};
}

void ExposureMerge::Add(const Image<float>& readings, double exposure, float saturation,
                        const ReadingNoise& noise) {
  const auto per_exposure = static_cast<float>(1.0 / exposure);
  for (size_t p = 0; p < readings.pixels.size(); ++p) {
    const float v = readings.pixels[p];
    if (!(v < saturation)) {
      continue;
    }
    const float i = v * per_exposure;
    if (weight_.pixels[p] == 0.0F) {
      first_.pixels[p] = i;
    }
    const auto w =
        static_cast<float>(noise.Weight(static_cast<double>(first_.pixels[p]), exposure));
    weight_.pixels[p] += w;
    mean_.pixels[p] += w / weight_.pixels[p] * (i - mean_.pixels[p]);  // (1)
  }
}

Image<float> ExposureMerge::Radiance(float saturated) const {
  Image<float> radiance = mean_;
  for (size_t p = 0; p < radiance.pixels.size(); ++p) {
    if (weight_.pixels[p] == 0.0F) {
      radiance.pixels[p] = saturated;
    }
  }
  return radiance;
}

}  // namespace sateen
