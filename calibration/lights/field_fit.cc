#include "calibration/lights/field_fit.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calibration/fit/robust_spread.h"
#include "calibration/lights/field_equations.h"
#include "calibration/lights/light_residuals.h"
#include "core/gauss_newton.h"
#include "core/linear_algebra.h"

namespace sateen {
namespace {

constexpr int kWeightedRounds = 10;   // with Cauchy's weights
constexpr int kAdmissions = 3;        // selections of samples between fits of least squares
constexpr double kAsGood = 1.01;      // times the least held-out error
constexpr double kWeightScale = 2.0;  // times the residuals' spread
constexpr double kLeastGain = 1e-3;
constexpr double kLeastVariance = 1e-24;
constexpr double kConvergedMm = 1e-5;
constexpr double kLeastRoughness = 100.0;  // second differences of 0.1: rougher than any lens
constexpr int kRoughnessTrials = 6;        // each ten times the last

// Returns a grid of gains of 1 under all rays that meet the samples.
GainField GridUnder(const std::vector<SheetSample>& samples, const Light& led, double spacing_mm) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const SheetSample& sample : samples) {
    const Eigen::Vector2d at = ShadowOnTable(led.position_mm, sample.point_mm);
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const Eigen::Array2d extent_mm = (high - low).array();
  // No more knots than the rig's file may hold, however far the sheets reach.
  const double spacing = std::max(spacing_mm, extent_mm.maxCoeff() / (kMostFieldKnots - 3));
  const Eigen::Array2d intervals = (extent_mm / spacing).ceil().max(1.0);
  const Eigen::Vector2d slack = 0.5 * (intervals * spacing - extent_mm).matrix();
  GainField field{.origin_mm = low - slack - Eigen::Vector2d::Constant(spacing),
                  .spacing_mm = spacing,
                  .columns = static_cast<int>(intervals.x()) + 3,
                  .rows = static_cast<int>(intervals.y()) + 3};
  field.gain.assign(static_cast<size_t>(field.columns) * static_cast<size_t>(field.rows), 1.0);
  return field;
}

// Returns the light after a step of the unknowns of field_equations.h.
Light MovedLight(Light light, const Eigen::VectorXd& step) {
  light.position_mm += step.head<3>();
  light.flux_rgb.array() *= step.segment<3>(kFieldFluxAt).array().exp();
  for (size_t knot = 0; knot < light.field.gain.size(); ++knot) {
    double& gain = light.field.gain[knot];
    gain = std::max(gain + step[kFieldGainAt + static_cast<Eigen::Index>(knot)], kLeastGain);
  }
  return light;
}

class FieldFitter {
 public:
  FieldFitter(const std::vector<SheetSample>& samples, const Light& ruler,
              const FieldFitOptions& options)
      : samples_(samples),
        residuals_(samples, options.albedo),
        options_(options),
        priors_{ruler.position_mm, options.position_sd_mm, options.gain_sd},
        light_(ruler) {
    light_.model = LightModel::kLedField;
    light_.field = GridUnder(samples, ruler, options.spacing_mm);
  }

  [[nodiscard]] const Light& Current() const { return light_; }
  [[nodiscard]] int Iterations() const { return iterations_; }

  [[nodiscard]] std::vector<double> Residuals(const std::vector<size_t>& indices) const {
    return residuals_.Of(light_, indices);
  }

  void DescendWeighted(const std::vector<size_t>& indices, double roughness) {
    Descend(
        [&](const Light& light) {
          const std::vector<double> r = residuals_.Of(light, indices);
          return Equations(light, indices, r, CauchyWeights(r), roughness);
        },
        kWeightedRounds, 0.0);
  }

  void DescendSquares(const std::vector<size_t>& indices, double roughness) {
    Descend(
        [&](const Light& light) {
          return Equations(light, indices, residuals_.Of(light, indices), Ones(indices), roughness);
        },
        options_.most_iterations, kConvergedMm);
  }

  // Returns the largest roughness weight whose next step explains the held-out samples as well as
  // any; takes none of these steps.
  [[nodiscard]] double BestRoughness(const std::vector<size_t>& indices,
                                     const std::vector<size_t>& held_out) {
    const std::vector<double> r = Residuals(indices);
    const double variance = Variance(light_, indices);
    FieldNormal of_samples(UnknownCount());
    AddFieldSamples(samples_, light_, options_.albedo, indices, r, Ones(indices), of_samples);
    std::vector<std::pair<double, double>> tried;
    double least = std::numeric_limits<double>::infinity();
    for (int trial = 0; trial < kRoughnessTrials; ++trial) {
      const double roughness = kLeastRoughness * std::pow(10.0, trial);
      FieldNormal normal = of_samples;
      AddFieldPriors(light_, priors_, roughness, variance, normal);
      const Light next =
          MovedLight(light_, SolveNormal<Eigen::Dynamic>(normal.information, normal.gradient));
      ++iterations_;
      const std::vector<double> off = residuals_.Of(next, held_out);
      tried.emplace_back(roughness,
                         Rms(residuals_.Of(next, OnModel(held_out, off, SpreadOf(off)))));
      least = std::min(least, tried.back().second);
    }
    double best = kLeastRoughness;
    for (const auto& [roughness, rms] : tried) {
      best = rms <= kAsGood * least ? roughness : best;
    }
    return best;
  }

  // Gives flux what it shares with the gain, and returns the covariance of position and log flux.
  Eigen::MatrixXd Normalise(const std::vector<size_t>& used, double roughness) {
    const FieldNormal normal = Equations(light_, used, Residuals(used), Ones(used), roughness);
    // Derivatives of position and log flux, the latter with log of the mean gain, by the unknowns.
    Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(UnknownCount(), kFieldGainAt);
    shares.topRows(kFieldGainAt).setIdentity();
    const auto count = static_cast<double>(used.size());
    double mean = 0.0;
    for (const size_t index : used) {
      const FieldPrediction at = PredictWithField(samples_[index], light_, options_.albedo);
      mean += at.g / count;
      for (size_t i = 0; i < at.knots.value.size(); ++i) {
        shares.row(GainUnknown(light_.field, at.knots, i)).tail<3>().array() +=
            at.knots.value[i] / count;
      }
    }
    shares.bottomRows(UnknownCount() - kFieldGainAt) /= mean;
    light_.flux_rgb *= mean;
    for (double& gain : light_.field.gain) {
      gain = std::max(gain / mean, kLeastGain);
    }
    return shares.transpose() * SolveSymmetric(normal.information, shares);
  }

 private:
  static std::vector<double> Ones(const std::vector<size_t>& indices) {
    return std::vector<double>(indices.size(), 1.0);
  }

  // Returns Cauchy's weights, as wide as the residuals are.
  static std::vector<double> CauchyWeights(const std::vector<double>& r) {
    const double spread = SpreadOf(r);
    std::vector<double> weights(r.size() / 3);
    for (size_t i = 0; i < weights.size(); ++i) {
      const double squared =
          r[3 * i] * r[3 * i] + r[3 * i + 1] * r[3 * i + 1] + r[3 * i + 2] * r[3 * i + 2];
      weights[i] = 1.0 / (1.0 + squared / std::pow(kWeightScale * spread, 2));
    }
    return weights;
  }

  [[nodiscard]] Eigen::Index UnknownCount() const {
    return kFieldGainAt + static_cast<Eigen::Index>(light_.field.gain.size());
  }

  // Returns v of (2), from how neighbours differ, so that a model that is still wrong does not
  // stiffen itself.
  [[nodiscard]] double Variance(const Light& light, const std::vector<size_t>& indices) const {
    const double noise = residuals_.NoiseRms(light, indices);
    return std::max(noise * noise, kLeastVariance);
  }

  [[nodiscard]] FieldNormal Equations(const Light& light, const std::vector<size_t>& indices,
                                      const std::vector<double>& r,
                                      const std::vector<double>& weights, double roughness) const {
    FieldNormal normal(UnknownCount());
    AddFieldSamples(samples_, light, options_.albedo, indices, r, weights, normal);
    AddFieldPriors(light, priors_, roughness, Variance(light, indices), normal);
    return normal;
  }

  // Takes full steps until the light moves by less than `settled_mm`.
  template <typename EquationsAt>
  void Descend(const EquationsAt& equations_at, int most_steps, double settled_mm) {
    auto fit = MinimizeSquares<Eigen::Dynamic>(
        light_, equations_at, MovedLight,
        {.rule = StepRule::kFull, .max_iterations = most_steps, .min_relative_fall = 0.0},
        [&](const Eigen::VectorXd& step) { return step.head<3>().norm() < settled_mm; });
    light_ = std::move(fit.state);
    iterations_ += fit.iterations;
  }

  const std::vector<SheetSample>& samples_;
  LightResiduals residuals_;
  const FieldFitOptions& options_;
  FieldPriors priors_;
  Light light_;
  int iterations_ = 0;
};

Status CheckField(const Light& light) {
  if (!(light.position_mm.allFinite() && light.position_mm.z() > 0.0 &&
        light.flux_rgb.allFinite())) {
    return Fail(ErrorCode::kDegenerate,
                "the fit of the led+field model diverged; add tilted sheets");
  }
  return light.field.Validate("the fit of the led+field model");
}

}  // namespace

Status FieldFitOptions::Validate() const {
  const auto fail = [](std::string_view field, double value, std::string_view range) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {:g}; need {}", field, value, range);
  };
  if (!(albedo > 0.0 && albedo <= 1.0)) {
    return fail("albedo", albedo, "0 < albedo <= 1");
  }
  if (!(spacing_mm > 0.0 && std::isfinite(spacing_mm))) {
    return fail("spacing_mm", spacing_mm, "a number > 0");
  }
  if (!(gain_sd > 0.0 && std::isfinite(gain_sd))) {
    return fail("gain_sd", gain_sd, "a number > 0");
  }
  if (!(position_sd_mm > 0.0 && std::isfinite(position_sd_mm))) {
    return fail("position_sd_mm", position_sd_mm, "a number > 0");
  }
  if (most_iterations < 1) {
    return fail("most_iterations", most_iterations, "1 or more");
  }
  return {};
}

Result<FieldFit> FitField(const std::vector<SheetSample>& samples, const Light& ruler,
                          const std::vector<size_t>& indices, const std::vector<size_t>& held_out,
                          double roughness_weight, const FieldFitOptions& options) {
  if (Status status = options.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (ruler.model != LightModel::kLed) {
    return Fail(ErrorCode::kInvalidArgument, "the light is of the rung {}; need led",
                Name(ruler.model));
  }
  FieldFitter fitter(samples, ruler, options);
  FieldFit fit{.roughness_weight = roughness_weight};
  fitter.DescendWeighted(indices, roughness_weight);
  const auto admit = [&] {
    const std::vector<double> off = fitter.Residuals(indices);
    fit.used = OnModel(indices, off, SpreadOf(off));
  };
  admit();
  if (!held_out.empty()) {
    fit.roughness_weight = fitter.BestRoughness(fit.used, held_out);
  }
  for (int admission = 0; admission < kAdmissions; ++admission) {
    fitter.DescendSquares(fit.used, fit.roughness_weight);
    admit();
  }
  if (2 * fit.used.size() < indices.size()) {
    return Fail(ErrorCode::kDegenerate, "only {} of {} samples follow one light; need half",
                fit.used.size(), indices.size());
  }
  fit.covariance = fitter.Normalise(fit.used, fit.roughness_weight);
  fit.light = fitter.Current();
  fit.iterations = fitter.Iterations();
  if (Status status = CheckField(fit.light); !status) {
    return tl::unexpected(status.error());
  }
  return fit;
}

}  // namespace sateen
