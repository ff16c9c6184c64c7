#include "scanner/checks/signal_levels.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace sateen {
namespace {

constexpr int kBins = 4096;  // from black to saturation

class Histogram {
 public:
  explicit Histogram(float saturation) : bins_per_value_(static_cast<float>(kBins) / saturation) {}

  void Add(float value) {
    const float bin = value * bins_per_value_;
    const int index = bin > 0.0F ? static_cast<int>(std::min(bin, static_cast<float>(kBins))) : 0;
    ++counts_[static_cast<size_t>(index)];
    ++total_;
  }

  // Returns the fraction of saturation at or below which `share` of the values lie.
  [[nodiscard]] double Percentile(double share) const {
    const auto rank = static_cast<int64_t>(share * static_cast<double>(total_));
    int64_t below = 0;
    for (int bin = 0; bin <= kBins; ++bin) {
      below += counts_[static_cast<size_t>(bin)];
      if (below > rank) {
        return static_cast<double>(bin) / kBins;
      }
    }
    return 0.0;  // no values
  }

  [[nodiscard]] SignalLevels Levels() const {
    return {.peak = Percentile(0.999),
            .low = Percentile(0.1),
            .saturated = static_cast<double>(counts_[kBins]) /
                         static_cast<double>(std::max<int64_t>(1, total_))};
  }

 private:
  float bins_per_value_;
  std::array<int64_t, kBins + 1> counts_ = {};  // the last: saturated
  int64_t total_ = 0;
};

}  // namespace

SignalLevels LevelsOf(const RawMosaic& mosaic, const SensorReading& reading) {
  Histogram histogram(reading.saturation + reading.shift);
  for (const float site : mosaic.samples.pixels) {
    histogram.Add(site + reading.shift);
  }
  return histogram.Levels();
}

SignalLevels LevelsOf(const Photo& photo) {
  if (!photo.saturation) {
    return {};
  }
  Histogram histogram(*photo.saturation);
  for (const Image<float>& plane : photo.rgb.planes) {
    for (const float value : plane.pixels) {
      histogram.Add(value);
    }
  }
  return histogram.Levels();
}

Result<SignalLevels> ReadSignalLevels(const FrameFile& file) {
  if (!IsRawName(file.path)) {
    return ReadPhoto(file.path, Encoding::kAuto, file.limit).map([](const Photo& photo) {
      return LevelsOf(photo);
    });
  }
  return ReadRawMosaic(file.path, file.limit).and_then([&](const RawMosaic& mosaic) {
    return ReadingOf(file, mosaic).map([&](const SensorReading& reading) {
      return LevelsOf(mosaic, reading);
    });
  });
}

}  // namespace sateen
