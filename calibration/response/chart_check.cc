#include "calibration/response/chart_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace sateen {
namespace {

constexpr double kDarkShare = 0.01;      // of the range: least level of a light's brightest patch
constexpr double kSaturatedShare = 0.9;  // of the range: most of a light's darkest patch
constexpr double kNotable = 0.004;       // deviation from exposure time that is warned of
constexpr double kSameTime = 0.02;       // relative difference of equal exposure times

// Returns a level that no unsaturated site reaches: the highest reading, or the file's white.
double HighestDn(const ChartReadings& readings, const std::vector<PatchSample>& samples) {
  double highest = 0.0;
  for (const PatchSample& sample : samples) {
    highest = std::max(highest, sample.top_dn);
  }
  return std::min(highest, readings.file_white_dn);
}

// Returns, per light, the frame whose brightest patch is brightest without a saturated site.
std::map<size_t, size_t> BestFrames(const ChartReadings& readings,
                                    const std::vector<PatchSample>& samples) {
  const double highest_dn = HighestDn(readings, samples);
  std::set<size_t> spoilt;
  for (const PatchSample& sample : samples) {
    if (sample.top_dn >= highest_dn) {
      spoilt.insert(sample.frame);
    }
  }
  std::map<size_t, std::pair<size_t, double>> best;
  for (const PatchSample& sample : samples) {
    auto& [frame, brightness] = best[sample.light];
    if (!spoilt.contains(sample.frame) && sample.signal_dn > brightness) {
      frame = sample.frame;
      brightness = sample.signal_dn;
    }
  }
  std::map<size_t, size_t> frames;
  for (const auto& [light, found] : best) {
    if (found.second > 0.0) {
      frames[light] = found.first;
    }
  }
  return frames;
}

// Returns the exposure time whose frames of that light are as bright as this one.
std::optional<double> LikelyExposure(const ChartReadings& readings, const FrameBrightness& wrong) {
  const ChartFrame& frame = readings.frames[wrong.frame];
  const double likely_s = wrong.ratio * frame.exposure_s;
  for (const ChartFrame& other : readings.frames) {
    if (other.light == frame.light && std::abs(other.exposure_s / likely_s - 1.0) < kSameTime) {
      return other.exposure_s;
    }
  }
  return std::nullopt;
}

}  // namespace

std::vector<UnevenPatch> FindUnevenPatches(const ChartReadings& readings,
                                           const std::vector<PatchSample>& samples, double black_dn,
                                           double most_uneven) {
  std::vector<UnevenPatch> found;
  for (const auto& [light, frame] : BestFrames(readings, samples)) {
    for (size_t patch = 0; patch < readings.patches.size(); ++patch) {
      const double unevenness =
          UnevennessOf(readings.patches[patch], readings.frames[frame].dn[patch], black_dn);
      if (unevenness > most_uneven) {
        found.push_back({light, patch, frame, unevenness});
      }
    }
  }
  return found;
}

Status CheckChartLights(const ChartReadings& readings, const std::vector<PatchSample>& samples,
                        double black_dn) {
  std::map<size_t, std::vector<const PatchSample*>> samples_of_light;
  for (const ChartFrame& frame : readings.frames) {
    if (frame.light) {
      samples_of_light.try_emplace(*frame.light);
    }
  }
  for (const PatchSample& sample : samples) {
    samples_of_light[sample.light].push_back(&sample);
  }
  const double highest_dn = HighestDn(readings, samples);
  for (const auto& [light, own] : samples_of_light) {
    const std::string& name = readings.lights[light];
    if (own.empty()) {
      return Fail(ErrorCode::kBadData,
                  "light '{}': every patch is uneven; is the chart where it should be, clean and "
                  "in no shadow?",
                  name);
    }
    const auto [darkest, brightest] = std::ranges::minmax_element(
        own, {}, [](const PatchSample* sample) { return sample->signal_dn; });
    const PatchSample& bright = **brightest;
    const PatchSample& dark = **darkest;
    if (bright.signal_dn < kDarkShare * (readings.file_white_dn - black_dn)) {
      return Fail(ErrorCode::kBadData,
                  "{}: the chart is dark under light '{}': its brightest patch reads {:.0f} DN "
                  "above black; did the light come on?",
                  readings.frames[bright.frame].file, name, bright.signal_dn);
    }
    if (dark.signal_dn > kSaturatedShare * (highest_dn - dark.black_dn)) {
      return Fail(ErrorCode::kBadData,
                  "{}: every patch is saturated under light '{}' in all its frames; expose for "
                  "less",
                  readings.frames[dark.frame].file, name);
    }
  }
  return {};
}

Status CheckExposures(const ChartReadings& readings, const std::vector<FrameBrightness>& frames,
                      double most_off, std::vector<std::string>& warnings) {
  FrameBrightness worst;
  for (const FrameBrightness& frame : frames) {
    if (std::abs(std::log(frame.ratio)) > std::abs(std::log(worst.ratio))) {
      worst = frame;
    }
  }
  const ChartFrame& frame = readings.frames[worst.frame];
  if (std::abs(worst.ratio - 1.0) > most_off) {
    const std::optional<double> likely_s = LikelyExposure(readings, worst);
    return Fail(ErrorCode::kBadData,
                "{}: is {:.3g} times as bright as its {:g} s say by the other frames of light "
                "'{}'{}; are frames swapped, or was the light not the same?",
                frame.file, worst.ratio, frame.exposure_s, readings.lights[*frame.light],
                likely_s ? fmt::format(", as bright as {:g} s are", *likely_s) : "");
  }
  if (std::abs(worst.ratio - 1.0) > kNotable) {
    warnings.push_back(fmt::format(
        "{}: is {:+.1f} % off its exposure time; the light flickers or the shutter is not exact, "
        "and linearity is known no better",
        frame.file, 100.0 * (worst.ratio - 1.0)));
  }
  return {};
}

}  // namespace sateen
