#include "calibration/response/linearity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kReferenceFrom = 0.03;  // of the range from black to the highest reading
constexpr double kReferenceTo = 0.5;
constexpr double kBinRatio = 1.03;
constexpr double kSurelySaturated = 1.1;  // times the highest mean of the colour
constexpr size_t kFewestExposures = 3;
constexpr double kLowestLevelDn = 1.0;

using TimesOfLight = std::map<size_t, std::set<double>>;

class LinearityFit {
 public:
  LinearityFit(const ChartReadings& readings, const std::vector<PatchSample>& samples,
               const TimesOfLight& times_of_light, const LinearityOptions& options)
      : readings_(readings), samples_(samples), options_(options), times_of_light_(times_of_light) {
    for (const PatchSample& sample : samples_) {
      range_dn_ = std::max(range_dn_, sample.top_dn - sample.black_dn);
    }
  }

  Linearity Run() {
    FitSlopes();
    CompareFrames();
    FindSaturation();
    Compare();
    for (size_t c = 0; c < 3; ++c) {
      FillBins(c);
      FindRanges(result_.rgb[c]);
    }
    return std::move(result_);
  }

 private:
  [[nodiscard]] size_t SeriesOf(const PatchSample& sample) const {
    return (sample.light * readings_.patches.size() + sample.patch) * 3 + sample.colour;
  }
  [[nodiscard]] bool IsReference(const PatchSample& sample) const {
    return sample.signal_dn > kReferenceFrom * range_dn_ &&
           sample.signal_dn < kReferenceTo * range_dn_;
  }
  [[nodiscard]] double ExpectedDn(const PatchSample& sample) const {
    return slope_[SeriesOf(sample)] * sample.exposure_s;
  }

  // Fits (1).
  void FitSlopes() {
    const size_t count = readings_.lights.size() * readings_.patches.size() * 3;
    std::vector<double> products(count, 0.0);
    std::vector<double> squares(count, 0.0);
    for (const PatchSample& sample : samples_) {
      if (IsReference(sample)) {
        const double variance = std::max(sample.sd_dn * sample.sd_dn, 1e-8);
        products[SeriesOf(sample)] += sample.signal_dn * sample.exposure_s / variance;
        squares[SeriesOf(sample)] += sample.exposure_s * sample.exposure_s / variance;
      }
    }
    slope_.assign(count, 0.0);
    for (size_t i = 0; i < count; ++i) {
      slope_[i] = squares[i] > 0.0 ? products[i] / squares[i] : 0.0;
    }
  }

  // Compares each frame with the median over all, so that a wrong frame does not hide in its own
  // fit.
  void CompareFrames() {
    std::map<size_t, std::vector<double>> rates;  // of each series
    for (const PatchSample& sample : samples_) {
      if (IsReference(sample)) {
        rates[SeriesOf(sample)].push_back(sample.signal_dn / sample.exposure_s);
      }
    }
    std::map<size_t, double> middle;
    for (const auto& [series, values] : rates) {
      middle[series] = Median(values);
    }
    std::map<size_t, std::vector<double>> ratios;  // of each frame
    for (const PatchSample& sample : samples_) {
      if (IsReference(sample)) {
        ratios[sample.frame].push_back(sample.signal_dn / sample.exposure_s /
                                       middle[SeriesOf(sample)]);
      }
    }
    for (const auto& [frame, values] : ratios) {
      result_.frames.push_back({frame, Median(values)});
    }
  }

  void FindSaturation() {
    std::array<double, 3> highest = {};
    for (const PatchSample& sample : samples_) {
      highest[sample.colour] = std::max(highest[sample.colour], sample.signal_dn);
    }
    std::array<std::vector<double>, 3> sites;
    for (const PatchSample& sample : samples_) {
      if (ExpectedDn(sample) < kSurelySaturated * highest[sample.colour]) {
        continue;
      }
      const std::vector<uint8_t>& colour = readings_.patches[sample.patch].colour;
      const std::vector<uint16_t>& dn = readings_.frames[sample.frame].dn[sample.patch];
      for (size_t i = 0; i < dn.size(); ++i) {
        if (colour[i] == sample.colour) {
          sites[sample.colour].push_back(dn[i]);
        }
      }
    }
    for (size_t c = 0; c < 3; ++c) {
      if (sites[c].empty()) {
        continue;
      }
      const double level = Median(sites[c]);
      for (double& site : sites[c]) {
        site = std::abs(site - level);
      }
      result_.rgb[c].saturation_dn = level - 3.0 * kSdPerMad * Median(std::move(sites[c]));
      clipped_from_dn_ = std::min(clipped_from_dn_, *result_.rgb[c].saturation_dn);
    }
  }

  // Fills in (2). The median deviation of a frame counts as its standard deviation, too.
  void Compare() {
    std::map<size_t, double> off;  // of frames
    for (const FrameBrightness& frame : result_.frames) {
      off[frame.frame] = frame.ratio - 1.0;
    }
    for (const PatchSample& sample : samples_) {
      const double expected = ExpectedDn(sample);
      const bool is_of_series = times_of_light_.at(sample.light).size() >= kFewestExposures;
      if (is_of_series && expected > kLowestLevelDn) {
        const double clipped_from =
            result_.rgb[sample.colour].saturation_dn.value_or(clipped_from_dn_);
        result_.points.push_back({.colour = sample.colour,
                                  .expected_dn = expected,
                                  .measured_dn = sample.signal_dn,
                                  .is_clipped = sample.top_dn >= clipped_from});
        sd_.push_back(std::hypot(sample.sd_dn / expected, off[sample.frame]));
      }
    }
    black_dn_ = samples_.empty() ? 0.0 : samples_[0].black_dn;
  }

  void FillBins(size_t colour) {
    struct Sums {
      double weight = 0.0;
      double level = 0.0;
      double deviation = 0.0;
    };
    std::map<int, Sums> bins;
    for (size_t i = 0; i < result_.points.size(); ++i) {
      const LinearityPoint& point = result_.points[i];
      if (point.colour != colour || point.is_clipped || point.measured_dn < kLowestLevelDn) {
        continue;
      }
      const double weight = 1.0 / std::max(sd_[i] * sd_[i], 1e-12);
      Sums& sums =
          bins[static_cast<int>(std::floor(std::log(point.measured_dn) / std::log(kBinRatio)))];
      sums.weight += weight;
      sums.level += weight * point.measured_dn;
      sums.deviation += weight * (point.measured_dn / point.expected_dn - 1.0);
    }
    for (const auto& [bin, sums] : bins) {
      result_.rgb[colour].bins.push_back({.level_dn = sums.level / sums.weight,
                                          .deviation = sums.deviation / sums.weight,
                                          .sd = 1.0 / std::sqrt(sums.weight)});
    }
  }

  void FindRanges(ChannelLinearity& channel) const {
    const double start_dn = kReferenceFrom * range_dn_;
    const auto range = FindLinearRange(channel.bins, start_dn, options_.tolerance);
    if (!range) {
      return;  // from 0 to 0
    }
    channel.linear_from_dn = black_dn_ + range->from_dn;
    channel.linear_to_dn = black_dn_ + range->to_dn;
    channel.departs = range->departs;
    const auto fine = FindLinearRange(channel.bins, start_dn, kFineTolerance);
    if (fine) {
      channel.fine_to_dn = std::min(black_dn_ + fine->to_dn, channel.linear_to_dn);
    }
  }

  const ChartReadings& readings_;
  const std::vector<PatchSample>& samples_;
  const LinearityOptions options_;
  const TimesOfLight& times_of_light_;
  double range_dn_ = 0.0;
  double clipped_from_dn_ = std::numeric_limits<double>::infinity();
  std::vector<double> slope_;  // [DN/s] of each series; 0 where nothing could be used
  double black_dn_ = 0.0;
  std::vector<double> sd_;  // of each point, relative
  Linearity result_;
};

}  // namespace

Status LinearityOptions::Validate() const {
  if (!(tolerance > 0.0 && tolerance <= 0.2)) {
    return Fail(ErrorCode::kInvalidArgument, "tolerance = {:g}; need 0 < tolerance <= 0.2",
                tolerance);
  }
  return {};
}

Result<Linearity> FitLinearity(const ChartReadings& readings,
                               const std::vector<PatchSample>& samples,
                               const LinearityOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  TimesOfLight times_of_light;
  size_t most = 0;
  for (const PatchSample& sample : samples) {
    times_of_light[sample.light].insert(sample.exposure_s);
    most = std::max(most, times_of_light[sample.light].size());
  }
  if (most < kFewestExposures) {
    return Fail(ErrorCode::kBadData,
                "no light has frames of more than {} exposure time{}; linearity needs at least {}, "
                "best seven from a sixteenth to four times the usual one",
                most, most == 1 ? "" : "s", kFewestExposures);
  }
  return LinearityFit(readings, samples, times_of_light, options).Run();
}

}  // namespace sateen
