#include "calibration/light_fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calibration/light_residuals.h"
#include "calibration/robust_fit.h"

namespace sateen {
namespace {

constexpr size_t kFewestSamples = 50;
constexpr size_t kHeldOutEvery = 5;
constexpr double kExplained = 1.1;  // times the noise
constexpr double kStartAnisotropy = 1.0;

// A rough light on a higher rung than it has: an LED that faces the middle of the samples.
Light OnRung(const Light& rough, LightModel model, const std::vector<SheetSample>& samples) {
  Light light = rough;
  if (model == LightModel::kLed && rough.model != LightModel::kLed) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const SheetSample& sample : samples) {
      middle += sample.point_mm / static_cast<double>(samples.size());
    }
    light.axis = (middle - rough.position_mm).normalized();
    light.anisotropy = kStartAnisotropy;
  }
  light.model = model;
  return light;
}

// The flux that explains the samples' median best, for a start in the right units.
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

double WorstDirectionSd(const std::vector<SheetSample>& samples, const Eigen::Vector3d& position_mm,
                        const Eigen::Matrix3d& covariance) {
  double worst = 0.0;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector3d d = position_mm - sample.point_mm;
    const Eigen::Vector3d l = d.normalized();
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - l * l.transpose()) / d.norm();
    const Eigen::Matrix3d spread = across * covariance * across.transpose();
    worst = std::max(worst,
                     Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread, Eigen::EigenvaluesOnly)
                         .eigenvalues()
                         .maxCoeff());
  }
  return std::sqrt(worst);
}

Status CheckSamples(const std::vector<SheetSample>& samples) {
  if (samples.size() < kFewestSamples) {
    return Fail(ErrorCode::kDegenerate, "{} samples of the sheet; need at least {}", samples.size(),
                kFewestSamples);
  }
  const bool all_dark = std::ranges::all_of(
      samples, [](const SheetSample& s) { return s.radiance_rgb.maxCoeff() <= 0.0; });
  return all_dark ? Status(Fail(ErrorCode::kDegenerate, "the sheet is dark: the light never lit"))
                  : Status();
}

// The samples' indices, and which of them judge the rungs.
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

// One rung fitted to all samples but the held-out ones, and judged by those.
Result<RungFit> TryRung(const LightResiduals& residuals, LightModel model, const Light& start,
                        const Split& split, double& noise_rms) {
  Result<RobustFit> fit = FitRobustly(residuals, model, start, split.fitted, false);
  if (!fit) {
    return tl::unexpected(fit.error());
  }
  noise_rms = residuals.NoiseRms(fit->light, split.all);
  const std::vector<double> off = residuals.Of(fit->light, split.held_out);
  const std::vector<size_t> on_model =
      OnModel(split.held_out, off, std::max(SpreadOf(off), noise_rms));
  return RungFit{.light = fit->light,
                 .residual_rms = Rms(residuals.Of(fit->light, fit->used)),
                 .held_out_rms = Rms(residuals.Of(fit->light, on_model)),
                 .iterations = fit->iterations};
}

// Climbs the rungs until one explains the held-out samples; returns which did best.
Result<size_t> Climb(const LightResiduals& residuals, const Split& split, Light start,
                     const LightFitOptions& options, LightFit& result) {
  size_t chosen = 0;
  for (const LightModel model : {LightModel::kNear, LightModel::kLed}) {
    if (model > options.highest_rung) {
      break;
    }
    Light from = OnRung(start, model, residuals.Samples());
    ScaleFlux(residuals.Samples(), options.albedo, from);
    Result<RungFit> rung = TryRung(residuals, model, from, split, result.noise_rms);
    if (!rung && result.rungs.empty()) {
      return tl::unexpected(rung.error());
    }
    if (!rung) {
      break;  // what the lower rung has must do
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

// The chosen rung fitted to all samples, with what is uncertain of it.
Status FitToAll(const LightResiduals& residuals, const Light& start, const std::vector<size_t>& all,
                LightFit& result) {
  Result<RobustFit> fit = FitRobustly(residuals, start.model, start, all, true);
  if (!fit) {
    return tl::unexpected(fit.error());
  }
  result.light = fit->light;
  result.used = fit->used.size();
  result.left_out = all.size() - fit->used.size();
  const double scale = Rms(residuals.Of(fit->light, fit->used));
  const Eigen::MatrixXd covariance = fit->covariance * (scale * scale);
  result.position_sd_mm = covariance.diagonal().head<3>().cwiseSqrt();
  result.flux_sd = covariance.diagonal().tail<3>().cwiseSqrt();
  result.direction_sd_rad = WorstDirectionSd(residuals.Samples(), result.light.position_mm,
                                             covariance.topLeftCorner<3, 3>());
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
                "the rough light is distant; need its position_mm, to within some 50 mm");
  }
  const Split split(samples.size());
  const LightResiduals residuals(samples, options.albedo);
  LightFit result;
  Light start = rough;
  ScaleFlux(samples, options.albedo, start);
  const Result<size_t> chosen = Climb(residuals, split, start, options, result);
  if (!chosen) {
    return tl::unexpected(chosen.error());
  }
  const Light best = result.rungs[*chosen].light;
  if (Status status = FitToAll(residuals, best, split.all, result); !status) {
    return tl::unexpected(status.error());
  }
  return result;
}

}  // namespace sateen
