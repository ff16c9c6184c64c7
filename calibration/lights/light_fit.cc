#include "calibration/lights/light_fit.h"

#include <algorithm>
#include <cmath>

#include "calibration/fit/robust_spread.h"
#include "calibration/lights/field_fit.h"
#include "calibration/lights/light_residuals.h"
#include "calibration/lights/robust_fit.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr size_t kFewestOfALight = 50;
constexpr size_t kHeldOutEvery = 5;
constexpr double kExplained = 1.1;  // times the noise
constexpr double kStartAnisotropy = 1.0;
constexpr double kStartRoughness = 100.0;  // lambda of a field

Eigen::Vector3d MiddleOf(const std::vector<SheetSample>& samples) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const SheetSample& sample : samples) {
    middle += sample.point_mm / static_cast<double>(samples.size());
  }
  return middle;
}

// Returns the relative standard deviation of the irradiance at a point, from the covariance of
// position and log flux: d ln e = d ln phi - 2 l . ds / d. A flat sheet hardly tells the two apart,
// but well what they send together.
double IrradianceSd(const Eigen::MatrixXd& covariance, const Eigen::Vector3d& position_mm,
                    const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d d = position_mm - point_mm;
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(covariance.rows());
  gradient.head<3>() = -2.0 * d / d.squaredNorm();
  double variance = 0.0;
  for (Eigen::Index c = 1; c <= 3; ++c) {
    Eigen::VectorXd of_channel = gradient;
    of_channel[covariance.rows() - c] += 1.0;
    variance += of_channel.dot(covariance * of_channel) / 3.0;
  }
  return std::sqrt(variance);
}

// Puts a rough light on a rung: an LED without an axis faces the middle of the samples.
Light OnRung(const Light& rough, LightModel model, const std::vector<SheetSample>& samples) {
  Light light = rough;
  if (IsLed(model) && !IsLed(rough.model)) {
    light.axis = (MiddleOf(samples) - rough.position_mm).normalized();
    light.anisotropy = kStartAnisotropy;
  }
  light.model = std::min(model, LightModel::kLed);
  return light;
}

// Scales the flux to explain the median of the samples, for a start in the right units.
void ScaleFlux(const std::vector<SheetSample>& samples, double albedo, Light& light) {
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::vector<double> ratios;
    ratios.reserve(samples.size());
    for (const SheetSample& sample : samples) {
      const Incident in = IncidentAt(light, sample.point_mm);
      const double expected = albedo * in.e_rgb[c] * sample.normal.dot(in.l);
      if (expected > 0.0) {
        ratios.push_back(sample.radiance_rgb[c] / expected);
      }
    }
    const double ratio = ratios.empty() ? 0.0 : Median(std::move(ratios));
    light.flux_rgb[c] *= std::max(ratio, 1e-12);
  }
}

Status CheckSamples(const std::vector<SheetSample>& samples) {
  if (samples.size() < kFewestOfALight) {
    return Fail(ErrorCode::kDegenerate, "{} samples of the sheet; need at least {}", samples.size(),
                kFewestOfALight);
  }
  const bool all_dark = std::ranges::all_of(
      samples, [](const SheetSample& s) { return s.radiance_rgb.maxCoeff() <= 0.0; });
  return all_dark
             ? Status(Fail(ErrorCode::kDegenerate, "the sheet is dark: the light was never on"))
             : Status();
}

// Returns where the fit of a rung starts: from the rung below. A field starts from the ruler again,
// because an LED that fits badly may have gone far astray.
Light StartOf(LightModel model, const Light& below, const Light& rough,
              const std::vector<SheetSample>& samples, double albedo) {
  Light from = OnRung(model == LightModel::kLedField ? rough : below, model, samples);
  ScaleFlux(samples, albedo, from);
  return from;
}

// Indices of the samples, and which of them judge the rungs.
struct Split {
  std::vector<size_t> all;
  std::vector<size_t> fitted;
  std::vector<size_t> held_out;

  explicit Split(size_t count) : all(count) {
    for (size_t i = 0; i < count; ++i) {
      all[i] = i;
      (i % kHeldOutEvery == 0 ? held_out : fitted).push_back(i);
    }
  }
};

// Robust fit of a rung.
struct Fitted {
  RobustFit fit;
  double roughness_weight = 0.0;
};

// Fits any rung to the samples of these indices. Held-out samples, if there are any, choose the
// roughness of a field.
Result<Fitted> FitRung(const LightResiduals& residuals, LightModel model, const Light& start,
                       const std::vector<size_t>& indices, const std::vector<size_t>& held_out,
                       double roughness_weight, const LightFitOptions& options) {
  if (model != LightModel::kLedField) {
    Result<RobustFit> fit = FitRobustly(residuals, model, start, indices, held_out.empty());
    if (!fit) {
      return tl::unexpected(fit.error());
    }
    return Fitted{.fit = *std::move(fit)};
  }
  Light led = start;
  led.model = LightModel::kLed;
  Result<FieldFit> field = FitField(residuals.Samples(), led, indices, held_out, roughness_weight,
                                    {.albedo = options.albedo});
  if (!field) {
    return tl::unexpected(field.error());
  }
  return Fitted{.fit = {.light = std::move(field->light),
                        .used = std::move(field->used),
                        .iterations = field->iterations,
                        .covariance = std::move(field->covariance)},
                .roughness_weight = field->roughness_weight};
}

// Fits one rung to all samples but the held-out ones, and judges it by those.
Result<RungFit> TryRung(const LightResiduals& residuals, LightModel model, const Light& start,
                        const Split& split, const LightFitOptions& options, double& noise_rms) {
  Result<Fitted> fitted =
      FitRung(residuals, model, start, split.fitted, split.held_out, kStartRoughness, options);
  if (!fitted) {
    return tl::unexpected(fitted.error());
  }
  const RobustFit& fit = fitted->fit;
  noise_rms = residuals.NoiseRms(fit.light, split.all);
  const std::vector<double> off = residuals.Of(fit.light, split.held_out);
  const std::vector<size_t> on_model =
      OnModel(split.held_out, off, std::max(SpreadOf(off), noise_rms));
  return RungFit{.light = fit.light,
                 .residual_rms = Rms(residuals.Of(fit.light, fit.used)),
                 .held_out_rms = Rms(residuals.Of(fit.light, on_model)),
                 .iterations = fit.iterations,
                 .roughness_weight = fitted->roughness_weight};
}

// Climbs the rungs until one explains the held-out samples; returns the best one.
Result<size_t> Climb(const LightResiduals& residuals, const Split& split, const Light& rough,
                     const LightFitOptions& options, LightFit& result) {
  Light start = rough;
  size_t chosen = 0;
  for (const LightModel model : {LightModel::kNear, LightModel::kLed, LightModel::kLedField}) {
    if (model > options.highest_rung) {
      break;
    }
    const Light from = StartOf(model, start, rough, residuals.Samples(), options.albedo);
    Result<RungFit> rung = TryRung(residuals, model, from, split, options, result.noise_rms);
    if (!rung && result.rungs.empty()) {
      return tl::unexpected(rung.error());
    }
    if (!rung) {
      break;  // the lower rung must do
    }
    start = rung->light;
    result.rungs.push_back(std::move(*rung));
    if (result.rungs.back().held_out_rms < result.rungs[chosen].held_out_rms) {
      chosen = result.rungs.size() - 1;
    }
    if (result.rungs.back().held_out_rms <= kExplained * result.noise_rms) {
      break;
    }
  }
  return chosen;
}

// Fits the chosen rung to all samples, with its standard deviations.
Status FitToAll(const LightResiduals& residuals, const RungFit& best, const Light& rough,
                const std::vector<size_t>& all, const LightFitOptions& options, LightFit& result) {
  const LightModel model = best.light.model;
  const Light from = model == LightModel::kLedField
                         ? StartOf(model, rough, rough, residuals.Samples(), options.albedo)
                         : best.light;
  Result<Fitted> fitted = FitRung(residuals, model, from, all, {}, best.roughness_weight, options);
  if (!fitted) {
    return tl::unexpected(fitted.error());
  }
  const RobustFit* fit = &fitted->fit;
  result.light = fit->light;
  result.used = fit->used.size();
  result.left_out = all.size() - fit->used.size();
  const double scale = Rms(residuals.Of(fit->light, fit->used));
  const Eigen::MatrixXd covariance = fit->covariance * (scale * scale);
  result.position_sd_mm = covariance.diagonal().head<3>().cwiseSqrt();
  result.flux_sd = covariance.diagonal().tail<3>().cwiseSqrt();
  result.direction_sd_rad = WorstDirectionSd(residuals.Samples(), result.light.position_mm,
                                             covariance.topLeftCorner<3, 3>());
  result.light.position_sd_mm = result.position_sd_mm;
  result.light.irradiance_sd =
      IrradianceSd(covariance, result.light.position_mm, MiddleOf(residuals.Samples()));
  return {};
}

}  // namespace

Status LightFitOptions::Validate() const {
  if (!(albedo > 0.0 && albedo <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "albedo = {:g}; need 0 < albedo <= 1", albedo);
  }
  return {};
}

Result<LightFit> FitLight(const std::vector<SheetSample>& samples, const Light& rough,
                          const LightFitOptions& options) {
  if (Status status = options.Validate().and_then([&] { return CheckSamples(samples); }); !status) {
    return tl::unexpected(status.error());
  }
  if (rough.model == LightModel::kDistant) {
    return Fail(ErrorCode::kInvalidArgument,
                "the rough light is distant; need its position_mm, within some 50 mm");
  }
  const Split split(samples.size());
  const LightResiduals residuals(samples, options.albedo);
  LightFit result;
  const Result<size_t> chosen = Climb(residuals, split, rough, options, result);
  if (!chosen) {
    return tl::unexpected(chosen.error());
  }
  const RungFit best = result.rungs[*chosen];
  if (Status status = FitToAll(residuals, best, rough, split.all, options, result); !status) {
    return tl::unexpected(status.error());
  }
  return result;
}

}  // namespace sateen
