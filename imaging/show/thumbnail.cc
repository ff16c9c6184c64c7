#include "imaging/show/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sateen {

Thumbnail::Thumbnail(ImageSize size_px, int max_width, size_t channels)
    : factor_(std::max(1, (size_px.width + max_width - 1) / max_width)) {
  const ImageSize small = {std::max(1, size_px.width / factor_),
                           std::max(1, size_px.height / factor_)};
  sums_.assign(channels, Image<float>(small));
  counts_.assign(channels, Image<float>(small));
}

void Thumbnail::Add(int first_row, std::span<const Image<float>> planes,
                    const Image<uint8_t>* known) {
  const ImageSize small = sums_[0].Size();
  for (size_t c = 0; c < planes.size(); ++c) {
    const Image<float>& plane = planes[c];
    for (int y = 0; y < plane.height; ++y) {
      const int to_y = (first_row + y) / factor_;
      if (to_y >= small.height) {
        break;  // the rest of a division
      }
      const size_t row = plane.Index(0, y);
      for (int x = 0; x < std::min(plane.width, small.width * factor_); ++x) {
        const size_t p = row + static_cast<size_t>(x);
        if (std::isfinite(plane.pixels[p]) && (known == nullptr || known->pixels[p] != 0)) {
          sums_[c].At(x / factor_, to_y) += plane.pixels[p];
          counts_[c].At(x / factor_, to_y) += 1.0F;
        }
      }
    }
  }
}

Image<float> Thumbnail::Mean(size_t channel) const {
  Image<float> mean = sums_[channel];
  for (size_t p = 0; p < mean.pixels.size(); ++p) {
    mean.pixels[p] /= std::max(1.0F, counts_[channel].pixels[p]);
  }
  return mean;
}

Image<uint8_t> Thumbnail::Known() const {
  Image<uint8_t> known(counts_[0].Size());
  std::ranges::transform(counts_[0].pixels, known.pixels.begin(),
                         [](float count) { return count > 0.0F ? uint8_t{255} : uint8_t{0}; });
  return known;
}

Image3 Thumbnail::Colours(Image<float> red, Image<float> green, Image<float> blue) {
  Image3 rgb;
  rgb[0] = std::move(red);
  rgb[1] = std::move(green);
  rgb[2] = std::move(blue);
  return rgb;
}

}  // namespace sateen
