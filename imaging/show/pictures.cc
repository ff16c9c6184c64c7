#include "imaging/show/pictures.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "imaging/color.h"

namespace sateen {
namespace {

constexpr int kGap = 4;  // [px] between panels
constexpr uint8_t kPaperWhite = 255;
constexpr uint8_t kUnknownGrey = 96;  // pixels without a value
constexpr double kWhitePercentile = 0.995;

uint8_t Byte(float value) {
  return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0F, 1.0F) * 255.0F));
}

Rgb8 MakeRgb8(ImageSize size, uint8_t fill = 0) {
  return {Image<uint8_t>(size, fill), Image<uint8_t>(size, fill), Image<uint8_t>(size, fill)};
}

// Returns a colour from black, purple, red, yellow, white at equal steps.
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

// Returns the mean of each factor x factor block.
Image<uint8_t> Shrink(const Image<uint8_t>& image, int factor) {
  Image<uint8_t> small(std::max(1, image.width / factor), std::max(1, image.height / factor));
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      int sum = 0;
      for (int block = 0; block < factor * factor; ++block) {
        sum += image.At(x * factor + block % factor,
                        std::min(y * factor + block / factor, image.height - 1));
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

Rgb8 ShowLinear(const Image3& linear, float white) {
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

Rgb8 ShowRelief(const Image<float>& height) {
  const auto [lowest, highest] = std::ranges::minmax(height.pixels);
  Image<float> above(height.Size());
  std::ranges::transform(height.pixels, above.pixels.begin(),
                         [low = lowest](float z) { return z - low; });
  return ShowHeat(above, highest - lowest, Image<uint8_t>(height.Size(), 255));
}

Rgb8 Shrunk(const Rgb8& panel, int max_width) {
  const int factor = std::max(1, (panel[0].width + max_width - 1) / max_width);
  return {Shrink(panel[0], factor), Shrink(panel[1], factor), Shrink(panel[2], factor)};
}

Rgb8 Enlarged(const Rgb8& panel, int factor) {
  const int by = std::max(1, factor);
  Rgb8 large = MakeRgb8({panel[0].width * by, panel[0].height * by});
  for (size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < large[c].height; ++y) {
      for (int x = 0; x < large[c].width; ++x) {
        large[c].At(x, y) = panel[c].At(x / by, y / by);
      }
    }
  }
  return large;
}

Rgb8 ContactSheet(const std::vector<Rgb8>& panels, int columns) {
  SATEEN_CHECK(!panels.empty());
  const ImageSize size = panels[0][0].Size();
  const auto count = static_cast<int>(panels.size());
  const int across = std::min(columns, count);
  const int down = (count + columns - 1) / columns;
  Rgb8 sheet = MakeRgb8({across * (size.width + kGap) - kGap, down * (size.height + kGap) - kGap},
                        kPaperWhite);
  for (int i = 0; i < count; ++i) {
    const int left = i % columns * (size.width + kGap);
    const int top = i / columns * (size.height + kGap);
    for (size_t c = 0; c < 3; ++c) {
      const Image<uint8_t>& panel = panels[static_cast<size_t>(i)][c];
      SATEEN_CHECK(panel.Size() == size);
      for (int y = 0; y < size.height; ++y) {
        std::copy_n(&panel.At(0, y), size.width, &sheet[c].At(left, top + y));
      }
    }
  }
  return sheet;
}

Rgb8 SideBySide(const std::vector<Rgb8>& panels, int max_width) {
  std::vector<Rgb8> small;
  small.reserve(panels.size());
  for (const Rgb8& panel : panels) {
    small.push_back(Shrunk(panel, max_width));
  }
  return ContactSheet(small, static_cast<int>(small.size()));
}

}  // namespace sateen
