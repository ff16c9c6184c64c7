#include "calibration/response/response_fit.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace sateen {
namespace {

constexpr double kWellTested = 0.9;   // share of the range in which linearity should be tested
constexpr double kFineNoiseDn = 0.4;  // read noise below which rounding hides it
constexpr double kGainsDiffer = 0.01;

class ResponseFitter {
 public:
  ResponseFitter(const ChartReadings& readings, const ResponseFitOptions& options)
      : readings_(readings), options_(options) {}

  Result<ResponseFit> Run() {
    const bool has_dark =
        std::ranges::any_of(readings_.frames, [](const ChartFrame& frame) { return !frame.light; });
    if (!has_dark) {
      return Fail(
          ErrorCode::kBadData,
          "no dark frame; need at least a pair with all lights off, for the black level and "
          "the read noise");
    }
    samples_ = SamplesOf(readings_, dark_);
    result_.black_dn = dark_.black_dn;
    LeaveOutUneven();
    const Status status = CheckChartLights(readings_, samples_, dark_.black_dn)
                              .and_then([&] { return MeasureLinearity(); })
                              .and_then([&] { return SetWhite(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    Balance();
    Noise();
    Warn();
    return std::move(result_);
  }

 private:
  void LeaveOutUneven() {
    result_.uneven = FindUnevenPatches(readings_, samples_, dark_.black_dn, options_.most_uneven);
    for (const UnevenPatch& uneven : result_.uneven) {
      result_.warnings.push_back(fmt::format(
          "{}: patch '{}' is uneven by {:.0f} % and left out under light '{}'; look for dust, "
          "glare or a shadow",
          readings_.frames[uneven.frame].file, readings_.patch_names[uneven.patch],
          100.0 * uneven.unevenness, readings_.lights[uneven.light]));
    }
    std::erase_if(samples_, [&](const PatchSample& sample) {
      return std::ranges::any_of(result_.uneven, [&](const UnevenPatch& uneven) {
        return uneven.light == sample.light && uneven.patch == sample.patch;
      });
    });
  }

  Status MeasureLinearity() {
    Result<Linearity> linearity = FitLinearity(readings_, samples_, options_.linearity);
    if (!linearity) {
      return tl::unexpected(linearity.error());
    }
    result_.linearity = std::move(*linearity);
    return CheckExposures(readings_, result_.linearity.frames, options_.most_off, result_.warnings);
  }

  [[nodiscard]] bool IsHiddenByNoise(const ChannelLinearity& channel) const {
    return std::ranges::none_of(channel.bins, [&](const LinearityBin& bin) {
      return bin.sd <= 0.5 * options_.linearity.tolerance;
    });
  }

  // Sets white to saturation, or to where a colour stops being linear.
  Status SetWhite() {
    double departs_dn = std::numeric_limits<double>::infinity();
    double tested_dn = std::numeric_limits<double>::infinity();
    for (const ChannelLinearity& channel : result_.linearity.rgb) {
      if (channel.linear_to_dn <= 0.0 && IsHiddenByNoise(channel)) {
        return Fail(ErrorCode::kBadData,
                    "noise hides whether readings are proportional to exposure time to within {:g} "
                    "%; need larger patches or more frames of each exposure, or a looser tolerance",
                    100.0 * options_.linearity.tolerance);
      }
      if (channel.linear_to_dn <= 0.0) {
        return Fail(ErrorCode::kBadData,
                    "the readings are nowhere proportional to exposure time to within {:g} %; need "
                    "RAW files without a tone curve, and frames whose exposure_s is right",
                    100.0 * options_.linearity.tolerance);
      }
      if (channel.saturation_dn) {
        result_.saturation_dn = std::min(result_.saturation_dn.value_or(*channel.saturation_dn),
                                         *channel.saturation_dn);
      }
      (channel.departs ? departs_dn : tested_dn) =
          std::min(channel.departs ? departs_dn : tested_dn, channel.linear_to_dn);
    }
    const double saturation_dn = result_.saturation_dn.value_or(readings_.file_white_dn);
    result_.white_dn = std::min(saturation_dn, departs_dn);
    if (!result_.saturation_dn) {
      result_.warnings.push_back(
          fmt::format("no patch is saturated in any frame, so white is the {:g} DN that the files "
                      "state; add an "
                      "exposure that saturates the white patch",
                      readings_.file_white_dn));
    }
    const double needed_dn = dark_.black_dn + kWellTested * (result_.white_dn - dark_.black_dn);
    if (std::isfinite(tested_dn) && tested_dn < needed_dn) {
      result_.warnings.push_back(fmt::format(
          "linearity is tested up to {:.0f} of {:.0f} DN; add exposures that put a patch between",
          tested_dn, result_.white_dn));
    }
    return {};
  }

  // Returns half of the range. Where a sensor bends by 1 %, its slope has changed by several per
  // cent, and noise and colours follow the slope.
  [[nodiscard]] double WellLinearDn() const {
    return dark_.black_dn + 0.5 * (result_.white_dn - dark_.black_dn);
  }

  [[nodiscard]] bool IsLinear(const PatchSample& sample) const {
    const ChannelLinearity& channel = result_.linearity.rgb[sample.colour];
    return sample.top_dn < WellLinearDn() &&
           sample.signal_dn + sample.black_dn >= channel.linear_from_dn;
  }

  void Balance() {
    std::vector<PatchSample> linear;
    std::ranges::copy_if(samples_, std::back_inserter(linear),
                         [&](const PatchSample& sample) { return IsLinear(sample); });
    result_.lights = BalanceLights(linear, readings_.reflectance_rgb, readings_.lights.size());
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Vector3d variance = Eigen::Vector3d::Zero();
    double count = 0.0;
    for (const std::optional<LightBalance>& light : result_.lights) {
      if (light) {
        mean += light->white_balance.array().log().matrix();
        variance += light->sd.cwiseQuotient(light->white_balance).cwiseAbs2();
        count += 1.0;
      }
    }
    if (count > 0.0) {
      result_.white_balance = (mean / count).array().exp();
      result_.white_balance_sd = (variance.cwiseSqrt() / count).cwiseProduct(result_.white_balance);
    } else {
      result_.warnings.push_back(
          "white balance is left at 1: no patch is linear in all three colours; add exposures that "
          "put patches between a hundredth and half of white");
    }
  }

  void Noise() {
    Result<PhotonTransfer> transfer = FitPhotonTransfer(
        TransferPoints(readings_, samples_, WellLinearDn()), /*use_dark=*/!dark_.is_cut);
    if (transfer) {
      result_.transfer = std::move(*transfer);
    } else {
      result_.warnings.push_back("gain and read noise are left out: " + transfer.error().message);
    }
  }

  void Warn() {
    if (dark_.is_cut) {
      result_.warnings.push_back(
          "dark frames read 0 at many sites: this camera cuts off values below black, so the black "
          "level is too high by part of the read noise; the read noise is from lit pairs alone");
    }
    if (!result_.transfer) {
      return;
    }
    const PhotonTransfer& transfer = *result_.transfer;
    if (transfer.read_noise_dn < kFineNoiseDn) {
      result_.warnings.push_back(fmt::format(
          "read noise is {:.2g} DN, which rounding to whole DN hides: the figure is rough",
          transfer.read_noise_dn));
    }
    for (size_t c = 0; c < 3; ++c) {
      const double off = transfer.gain_rgb[c] / transfer.gain_dn_per_electron - 1.0;
      if (std::abs(off) > kGainsDiffer &&
          std::abs(off) * transfer.gain_dn_per_electron > 4.0 * transfer.gain_rgb_sd[c]) {
        constexpr std::array<std::string_view, 3> kNames = {"red", "green", "blue"};
        result_.warnings.push_back(fmt::format(
            "the gain of {} alone is {:+.1f} % off that of all: does the camera multiply "
            "colours before it writes the file?",
            kNames[c], 100.0 * off));
      }
    }
  }

  const ChartReadings& readings_;
  const ResponseFitOptions options_;
  DarkLevel dark_;
  std::vector<PatchSample> samples_;
  ResponseFit result_;
};

}  // namespace

Status ResponseFitOptions::Validate() const {
  if (!(most_uneven > 0.0 && most_uneven <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "most_uneven = {:g}; need 0 < most_uneven <= 1",
                most_uneven);
  }
  if (!(most_off > 0.0 && most_off <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "most_off = {:g}; need 0 < most_off <= 1", most_off);
  }
  return linearity.Validate();
}

Result<ResponseFit> FitResponse(const ChartReadings& readings, const ResponseFitOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  return ResponseFitter(readings, options).Run();
}

}  // namespace sateen
