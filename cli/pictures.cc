#include "cli/pictures.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "imaging/color.h"

namespace sateen::cli {
namespace {

constexpr int kGap = 4;               // [px] between panels
constexpr uint8_t kUnknownGrey = 96;  // pixels without a value
constexpr double kWhitePercentile = 0.995;

uint8_t Byte(float value) {
  return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0F, 1.0F) * 255.0F));
}

Rgb8 MakeRgb8(ImageSize size, uint8_t fill = 0) {
  return {Image<uint8_t>(size, fill), Image<uint8_t>(size, fill), Image<uint8_t>(size, fill)};
}

// The value that is to be shown as white; 1 for an image without light.
float WhiteOf(const Image3& linear) {
  std::vector<float> peaks;
  for (size_t p = 0; p < linear[0].pixels.size(); ++p) {
    const float peak = std::max({linear[0].pixels[p], linear[1].pixels[p], linear[2].pixels[p]});
    if (peak > 0.0F && std::isfinite(peak)) {
      peaks.push_back(peak);
    }
  }
  if (peaks.empty()) {
    return 1.0F;
  }
  const auto place = peaks.begin() + static_cast<std::ptrdiff_t>(
                                         kWhitePercentile * static_cast<double>(peaks.size() - 1));
  std::nth_element(peaks.begin(), place, peaks.end());
  return *place;
}

// Black, purple, red, yellow, white at equal steps.
std::array<uint8_t, 3> HeatColor(float t) {
  constexpr std::array<std::array<float, 3>, 5> kStops = {{{0.0F, 0.0F, 0.0F},
                                                           {0.4F, 0.0F, 0.6F},
                                                           {0.9F, 0.2F, 0.1F},
                                                           {1.0F, 0.8F, 0.1F},
                                                           {1.0F, 1.0F, 1.0F}}};
  const float place = std::clamp(t, 0.0F, 1.0F) * static_cast<float>(kStops.size() - 1);
  const auto below = std::min(static_cast<size_t>(place), kStops.size() - 2);
  std::array<uint8_t, 3> color;
  for (size_t c = 0; c < 3; ++c) {
    color[c] =
        Byte(std::lerp(kStops[below][c], kStops[below + 1][c], place - static_cast<float>(below)));
  }
  return color;
}

// The mean of each factor x factor block.
Image<uint8_t> Shrink(const Image<uint8_t>& image, int factor) {
  Image<uint8_t> small(image.width / factor, image.height / factor);
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      int sum = 0;
      for (int block = 0; block < factor * factor; ++block) {
        sum += image.At(x * factor + block % factor, y * factor + block / factor);
      }
      small.At(x, y) = static_cast<uint8_t>(sum / (factor * factor));
    }
  }
  return small;
}

}  // namespace

std::array<Image<uint16_t>, 3> EncodeNormal16(const Image3& normal) {
  std::array<Image<uint16_t>, 3> encoded;
  for (size_t c = 0; c < 3; ++c) {
    encoded[c] = Image<uint16_t>(normal.Size());
    std::transform(normal[c].pixels.begin(), normal[c].pixels.end(), encoded[c].pixels.begin(),
                   [](float n) {
                     return static_cast<uint16_t>(
                         std::lround(std::clamp(0.5F + 0.5F * n, 0.0F, 1.0F) * 65535.0F));
                   });
  }
  return encoded;
}

Rgb8 ShowLinear(const Image3& linear) {
  const float white = WhiteOf(linear);
  Rgb8 shown = MakeRgb8(linear.Size());
  for (size_t c = 0; c < 3; ++c) {
    std::transform(linear[c].pixels.begin(), linear[c].pixels.end(), shown[c].pixels.begin(),
                   [&](float value) {
                     return std::isfinite(value) ? Byte(SrgbFromLinear(value / white)) : uint8_t{0};
                   });
  }
  return shown;
}

Rgb8 ShowNormal(const Image3& normal) {
  Rgb8 shown = MakeRgb8(normal.Size());
  for (size_t c = 0; c < 3; ++c) {
    std::transform(normal[c].pixels.begin(), normal[c].pixels.end(), shown[c].pixels.begin(),
                   [](float n) { return Byte(0.5F + 0.5F * n); });
  }
  return shown;
}

Rgb8 ShowHeat(const Image<float>& values, float top, const Image<uint8_t>& shown) {
  Rgb8 heat = MakeRgb8(values.Size(), kUnknownGrey);
  for (size_t p = 0; p < values.pixels.size(); ++p) {
    if (shown.pixels[p] == 0) {
      continue;
    }
    const std::array<uint8_t, 3> color = HeatColor(top > 0.0F ? values.pixels[p] / top : 0.0F);
    for (size_t c = 0; c < 3; ++c) {
      heat[c].pixels[p] = color[c];
    }
  }
  return heat;
}

Rgb8 SideBySide(const std::vector<Rgb8>& panels, int max_width) {
  SATEEN_CHECK(!panels.empty());
  const ImageSize size = panels[0][0].Size();
  const int factor = std::max(1, (size.width + max_width - 1) / max_width);
  const ImageSize small{std::max(1, size.width / factor), std::max(1, size.height / factor)};
  const auto count = static_cast<int>(panels.size());
  Rgb8 sheet = MakeRgb8({count * (small.width + kGap) - kGap, small.height}, 255);
  for (int i = 0; i < count; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const Image<uint8_t> panel = Shrink(panels[static_cast<size_t>(i)][c], factor);
      for (int y = 0; y < panel.height; ++y) {
        std::copy_n(&panel.At(0, y), panel.width, &sheet[c].At(i * (small.width + kGap), y));
      }
    }
  }
  return sheet;
}

}  // namespace sateen::cli
