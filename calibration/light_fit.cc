#include "calibration/light_fit.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace sateen {
namespace {

constexpr size_t kFewestSamples = 50;
constexpr size_t kHeldOutEvery = 5;
constexpr double kLossScale = 2.0;  // of the residuals' spread
constexpr int kRobustRounds = 4;
constexpr double kOutlierScale = 4.0;    // of the residuals' own spread
constexpr double kExplained = 1.1;       // times the noise
constexpr double kMadToSd = 1.4826;      // of a normal distribution
constexpr double kReferenceMm = 1000.0;  // where flux is irradiance
constexpr double kLargestAnisotropy = 50.0;
constexpr double kLeastEigenvalue = 1e-12;  // of the scaled normal equations
constexpr double kStartAnisotropy = 1.0;

// A light as the solver moves it.
struct Unknowns {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d log_flux;
  Eigen::Vector3d axis;
  double anisotropy;

  explicit Unknowns(const Light& light)
      : position_mm(light.position_mm),
        log_flux(light.flux_rgb.array().log()),
        axis(light.axis),
        anisotropy(light.anisotropy) {}

  [[nodiscard]] Light AsLight(const Light& like, LightModel model) const {
    Light light = like;
    light.model = model;
    light.position_mm = position_mm;
    light.flux_rgb = log_flux.array().exp();
    if (model == LightModel::kLed) {
      light.axis = axis.normalized();
      light.anisotropy = anisotropy;
    }
    return light;
  }
};

// The terms of (1) of one sample.
struct NearResidual {
  const SheetSample* sample;
  double albedo;

  template <typename T>
  void Evaluate(const T* position, const T* log_flux, const T& emission, T* residual) const {
    const Eigen::Matrix<T, 3, 1> d =
        Eigen::Map<const Eigen::Matrix<T, 3, 1>>(position) - sample->point_mm.cast<T>();
    const T distance2 = d.squaredNorm();
    const T shading = emission * albedo * kReferenceMm * kReferenceMm *
                      d.dot(sample->normal.cast<T>()) / (distance2 * sqrt(distance2));
    for (int c = 0; c < 3; ++c) {
      residual[c] = (shading * exp(log_flux[c]) - sample->radiance_rgb[c]) / sample->sd_rgb[c];
    }
  }

  template <typename T>
  bool operator()(const T* position, const T* log_flux, T* residual) const {
    Evaluate(position, log_flux, T(1.0), residual);
    return true;
  }
};

struct LedResidual {
  NearResidual near;

  template <typename T>
  bool operator()(const T* position, const T* log_flux, const T* axis, const T* anisotropy,
                  T* residual) const {
    const Eigen::Matrix<T, 3, 1> from_light =
        near.sample->point_mm.cast<T>() - Eigen::Map<const Eigen::Matrix<T, 3, 1>>(position);
    const T cosine =
        from_light.dot(Eigen::Map<const Eigen::Matrix<T, 3, 1>>(axis)) / from_light.norm();
    if (!(cosine > T(0.0))) {
      return false;  // the light faces away: no step to take
    }
    near.Evaluate(position, log_flux, T(pow(cosine, anisotropy[0])), residual);
    return true;
  }
};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class Fitter {
 public:
  Fitter(const std::vector<SheetSample>& samples, double albedo)
      : samples_(samples), albedo_(albedo) {}

  // Fits `unknowns` to the samples of these indices. `loss` is in units of sd_rgb; 0: squares.
  Result<int> Fit(LightModel model, const std::vector<size_t>& indices, double loss,
                  Unknowns& unknowns, ceres::Problem& problem) const {
    for (const size_t index : indices) {
      ceres::LossFunction* robust = loss > 0.0 ? new ceres::CauchyLoss(loss) : nullptr;
      const NearResidual near{&samples_[index], albedo_};
      if (model == LightModel::kLed) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<LedResidual, 3, 3, 3, 3, 1>(new LedResidual{near}),
            robust, unknowns.position_mm.data(), unknowns.log_flux.data(), unknowns.axis.data(),
            &unknowns.anisotropy);
      } else {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<NearResidual, 3, 3, 3>(new NearResidual(near)), robust,
            unknowns.position_mm.data(), unknowns.log_flux.data());
      }
    }
    if (model == LightModel::kLed) {
      problem.SetManifold(unknowns.axis.data(), new ceres::SphereManifold<3>());
      problem.SetParameterLowerBound(&unknowns.anisotropy, 0, 0.0);
      problem.SetParameterUpperBound(&unknowns.anisotropy, 0, kLargestAnisotropy);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 50;
    options.function_tolerance = 1e-12;
    options.parameter_tolerance = 1e-12;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) {
      return Fail(ErrorCode::kDegenerate, "the fit of the {} model failed: {}", Name(model),
                  summary.message);
    }
    return static_cast<int>(summary.iterations.size());
  }

  // Residuals of (1), three a sample.
  [[nodiscard]] std::vector<double> Residuals(const Light& light,
                                              const std::vector<size_t>& indices) const {
    std::vector<double> residuals;
    residuals.reserve(3 * indices.size());
    for (const size_t index : indices) {
      const SheetSample& sample = samples_[index];
      const Incident in = IncidentAt(light, sample.point_mm);
      const double shading = albedo_ * std::max(0.0, sample.normal.dot(in.l));
      for (Eigen::Index c = 0; c < 3; ++c) {
        residuals.push_back((shading * in.e_rgb[c] - sample.radiance_rgb[c]) / sample.sd_rgb[c]);
      }
    }
    return residuals;
  }

  // The robust spread of how neighbours differ in how they lie off a model: noise, whatever it lacks.
  [[nodiscard]] double NoiseRms(const Light& light, const std::vector<size_t>& indices) const {
    const std::vector<double> residuals = Residuals(light, indices);
    std::vector<double> differences;
    differences.reserve(residuals.size());
    for (size_t i = 3; i < residuals.size(); ++i) {
      differences.push_back(std::abs(residuals[i] - residuals[i - 3]));
    }
    return kMadToSd * Median(std::move(differences)) / std::sqrt(2.0);
  }

 private:
  const std::vector<SheetSample>& samples_;
  double albedo_;
};

double Rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value * value;
  }
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(values.size(), 1)));
}

// Those of the indices whose residuals, all three, are within `limit`.
std::vector<size_t> Within(const std::vector<size_t>& indices, const std::vector<double>& residuals,
                           double limit) {
  std::vector<size_t> within;
  within.reserve(indices.size());
  for (size_t i = 0; i < indices.size(); ++i) {
    const double worst = std::max({std::abs(residuals[3 * i]), std::abs(residuals[3 * i + 1]),
                                   std::abs(residuals[3 * i + 2])});
    if (worst <= limit) {
      within.push_back(indices[i]);
    }
  }
  return within;
}

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

// Fits one rung robustly to `indices`: rounds of a loss as wide as the residuals then are, so that it
// closes in on those that follow the light; then squares without what lies off.
struct RobustFit {
  Light light;
  std::vector<size_t> used = {};
  int iterations = 0;
  Eigen::MatrixXd covariance = {};  // of position and log flux, 6 x 6, for residuals of variance 1
};

double SpreadOf(const std::vector<double>& residuals) {
  std::vector<double> sizes(residuals.size());
  std::ranges::transform(residuals, sizes.begin(), [](double r) { return std::abs(r); });
  return std::max(kMadToSd * Median(std::move(sizes)), 1e-12);
}

// Of all unknowns in the order in which they were added: the inverse of J^T J at the solution.
Result<Eigen::MatrixXd> CovarianceOf(ceres::Problem& problem) {
  ceres::CRSMatrix jacobian;
  problem.Evaluate(ceres::Problem::EvaluateOptions(), nullptr, nullptr, nullptr, &jacobian);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
  for (size_t row = 0; row + 1 < jacobian.rows.size(); ++row) {
    const int begin = jacobian.rows[row];
    const int end = jacobian.rows[row + 1];
    for (int i = begin; i < end; ++i) {
      for (int j = begin; j < end; ++j) {
        const auto at_i = static_cast<size_t>(i);
        const auto at_j = static_cast<size_t>(j);
        normal(jacobian.cols[at_i], jacobian.cols[at_j]) +=
            jacobian.values[at_i] * jacobian.values[at_j];
      }
    }
  }
  // Unknowns have units of their own; only after each is scaled does the rank mean something.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (!(eigen.eigenvalues().minCoeff() > kLeastEigenvalue)) {
    return Fail(ErrorCode::kDegenerate, "the sheets do not determine the light; add tilted sheets");
  }
  const Eigen::MatrixXd inverse = eigen.eigenvectors() *
                                  eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose();
  return Eigen::MatrixXd(scale.cwiseInverse().asDiagonal() * inverse *
                         scale.cwiseInverse().asDiagonal());
}

Result<RobustFit> FitRobustly(const Fitter& fitter, LightModel model, const Light& start,
                              const std::vector<size_t>& indices, bool with_covariance) {
  Unknowns unknowns(start);
  RobustFit fit{.light = start};
  for (int round = 0; round < kRobustRounds; ++round) {
    const double spread = SpreadOf(fitter.Residuals(fit.light, indices));
    ceres::Problem problem;
    const Result<int> steps = fitter.Fit(model, indices, kLossScale * spread, unknowns, problem);
    if (!steps) {
      return tl::unexpected(steps.error());
    }
    fit.light = unknowns.AsLight(start, model);
    fit.iterations += *steps;
  }
  const std::vector<double> residuals = fitter.Residuals(fit.light, indices);
  fit.used = Within(indices, residuals, kOutlierScale * SpreadOf(residuals));
  if (2 * fit.used.size() < indices.size()) {
    return Fail(ErrorCode::kDegenerate,
                "only {} of {} samples follow one light; need half: is it this light, and white "
                "paper that fills the table?",
                fit.used.size(), indices.size());
  }
  ceres::Problem last;
  const Result<int> steps = fitter.Fit(model, fit.used, 0.0, unknowns, last);
  if (!steps) {
    return tl::unexpected(steps.error());
  }
  fit.light = unknowns.AsLight(start, model);
  fit.iterations += *steps;
  if (with_covariance) {
    const Result<Eigen::MatrixXd> covariance = CovarianceOf(last);
    if (!covariance) {
      return tl::unexpected(covariance.error());
    }
    fit.covariance = covariance->topLeftCorner(6, 6);
  }
  return fit;
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
  std::vector<size_t> all(samples.size());
  std::vector<size_t> fitted;
  std::vector<size_t> held_out;
  for (size_t i = 0; i < samples.size(); ++i) {
    all[i] = i;
    (i % kHeldOutEvery == 0 ? held_out : fitted).push_back(i);
  }
  const Fitter fitter(samples, options.albedo);
  LightFit result;
  Light start = rough;
  ScaleFlux(samples, options.albedo, start);
  size_t chosen = 0;
  for (const LightModel model : {LightModel::kNear, LightModel::kLed}) {
    if (model > options.highest_rung) {
      break;
    }
    Light from = OnRung(start, model, samples);
    ScaleFlux(samples, options.albedo, from);
    Result<RobustFit> fit = FitRobustly(fitter, model, from, fitted, false);
    if (!fit && result.rungs.empty()) {
      return tl::unexpected(fit.error());
    }
    if (!fit) {
      break;  // what the lower rung has must do
    }
    result.noise_rms = fitter.NoiseRms(fit->light, all);
    const std::vector<double> off = fitter.Residuals(fit->light, held_out);
    const std::vector<size_t> on_model =
        Within(held_out, off, kOutlierScale * std::max(SpreadOf(off), result.noise_rms));
    result.rungs.push_back({.light = fit->light,
                            .residual_rms = Rms(fitter.Residuals(fit->light, fit->used)),
                            .held_out_rms = Rms(fitter.Residuals(fit->light, on_model)),
                            .iterations = fit->iterations});
    if (result.rungs.back().held_out_rms < result.rungs[chosen].held_out_rms) {
      chosen = result.rungs.size() - 1;
    }
    start = fit->light;
    if (result.rungs.back().held_out_rms <= kExplained * result.noise_rms) {
      break;
    }
  }
  const RungFit& best = result.rungs[chosen];
  Result<RobustFit> fit = FitRobustly(fitter, best.light.model, best.light, all, true);
  if (!fit) {
    return tl::unexpected(fit.error());
  }
  result.light = fit->light;
  result.used = fit->used.size();
  result.left_out = samples.size() - fit->used.size();
  const double scale = Rms(fitter.Residuals(fit->light, fit->used));
  const Eigen::MatrixXd covariance = fit->covariance * (scale * scale);
  result.position_sd_mm = covariance.diagonal().head<3>().cwiseSqrt();
  result.flux_sd = covariance.diagonal().tail<3>().cwiseSqrt();
  result.direction_sd_rad =
      WorstDirectionSd(samples, result.light.position_mm, covariance.topLeftCorner<3, 3>());
  return result;
}

}  // namespace sateen
