#include "scanner/sessions/frames/exposure_merge.h"

#include <algorithm>

namespace sateen {
namespace {

constexpr int kSamplesAround = 2;  // samples of a kind to each side

// Sums of kSamplesAround samples to each side, `stride` apart, along rows or along columns.
void SumAlong(bool rows, int stride, Image<float>& image) {
  const int count = rows ? image.width : image.height;
  const int lines = rows ? image.height : image.width;
  const auto at = [&](int line, int i) -> float& {
    return rows ? image.At(i, line) : image.At(line, i);
  };
  std::vector<float> copy(static_cast<size_t>(count));
  for (int line = 0; line < lines; ++line) {
    for (int i = 0; i < count; ++i) {
      copy[static_cast<size_t>(i)] = at(line, i);
    }
    for (int i = 0; i < count; ++i) {
      float sum = 0.0F;
      for (int k = i - kSamplesAround * stride; k <= i + kSamplesAround * stride; k += stride) {
        sum += k >= 0 && k < count ? copy[static_cast<size_t>(k)] : 0.0F;
      }
      at(line, i) = sum;
    }
  }
}

// Returns the mean of what is not saturated among the samples of one kind around each; at least one
// is.
Image<float> MeanAround(const Image<float>& readings, float saturation, int stride) {
  Image<float> sums = readings;
  Image<float> counts(readings.Size());
  for (size_t p = 0; p < sums.pixels.size(); ++p) {
    const bool counts_here = readings.pixels[p] < saturation;
    counts.pixels[p] = counts_here ? 1.0F : 0.0F;
    sums.pixels[p] = counts_here ? sums.pixels[p] : 0.0F;
  }
  for (const bool rows : {true, false}) {
    SumAlong(rows, stride, sums);
    SumAlong(rows, stride, counts);
  }
  for (size_t p = 0; p < sums.pixels.size(); ++p) {
    sums.pixels[p] /= std::max(counts.pixels[p], 1.0F);
  }
  return sums;
}

}  // namespace

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
  const bool depends_on_radiance = noise.floor > 0.0;
  const Image<float> around =
      depends_on_radiance ? MeanAround(readings, saturation, stride_) : readings;
  for (size_t p = 0; p < readings.pixels.size(); ++p) {
    const float v = readings.pixels[p];
    if (!(v < saturation)) {
      continue;
    }
    const float i = v * per_exposure;
    if (weight_.pixels[p] == 0.0F) {
      first_.pixels[p] = around.pixels[p] * per_exposure;
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
