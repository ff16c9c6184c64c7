#include "calibration/lights/light_residuals.h"

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/linear_algebra.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kReferenceMm = 1000.0;  // distance at which flux is irradiance
constexpr double kLargestAnisotropy = 50.0;
constexpr double kLeastEigenvalue = 1e-12;  // of the scaled normal matrix

// Unknowns of a light.
struct LightUnknowns {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d log_flux;
  Eigen::Vector3d axis;
  double anisotropy;

  explicit LightUnknowns(const Light& light)
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

// Residuals (1) of one sample.
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
      return false;  // the light faces away: the step is refused
    }
    near.Evaluate(position, log_flux, T(pow(cosine, anisotropy[0])), residual);
    return true;
  }
};

// Returns (J^T J)^-1 at the solution, unknowns in the order in which they were added.
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
  // Unknowns have units of their own. The rank has a meaning only after each is scaled.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
  if (!(DecomposeSymmetric(scaled).values[0] > kLeastEigenvalue)) {
    return Fail(ErrorCode::kDegenerate, "the sheets do not determine the light; add tilted sheets");
  }
  return Eigen::MatrixXd(scale.cwiseInverse().asDiagonal() * InverseOfSymmetric(scaled) *
                         scale.cwiseInverse().asDiagonal());
}

// Adds (1) of one sample.
void AddTo(ceres::Problem& problem, LightModel model, const NearResidual& near, double loss_scale,
           LightUnknowns& unknowns) {
  ceres::LossFunction* loss = loss_scale > 0.0 ? new ceres::CauchyLoss(loss_scale) : nullptr;
  if (model == LightModel::kLed) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<LedResidual, 3, 3, 3, 3, 1>(new LedResidual{near}), loss,
        unknowns.position_mm.data(), unknowns.log_flux.data(), unknowns.axis.data(),
        &unknowns.anisotropy);
  } else {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<NearResidual, 3, 3, 3>(new NearResidual(near)), loss,
        unknowns.position_mm.data(), unknowns.log_flux.data());
  }
}

ceres::Solver::Summary Solve(ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 50;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

}  // namespace

std::vector<double> LightResiduals::Of(const Light& light,
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

double LightResiduals::NoiseRms(const Light& light, const std::vector<size_t>& indices) const {
  const std::vector<double> residuals = Of(light, indices);
  std::vector<double> differences;
  differences.reserve(residuals.size());
  for (size_t i = 3; i < residuals.size(); ++i) {
    differences.push_back(std::abs(residuals[i] - residuals[i - 3]));
  }
  return differences.empty() ? 0.0 : kSdPerMad * Median(std::move(differences)) / std::sqrt(2.0);
}

Result<LightDescent> LightResiduals::Descend(LightModel model, const Light& start,
                                             const std::vector<size_t>& indices, double loss_scale,
                                             bool with_covariance) const {
  LightUnknowns unknowns(start);
  ceres::Problem problem;
  for (const size_t index : indices) {
    AddTo(problem, model, NearResidual{&samples_[index], albedo_}, loss_scale, unknowns);
  }
  if (model == LightModel::kLed) {
    problem.SetManifold(unknowns.axis.data(), new ceres::SphereManifold<3>());
    problem.SetParameterLowerBound(&unknowns.anisotropy, 0, 0.0);
    problem.SetParameterUpperBound(&unknowns.anisotropy, 0, kLargestAnisotropy);
  }
  const ceres::Solver::Summary summary = Solve(problem);
  if (!summary.IsSolutionUsable()) {
    return Fail(ErrorCode::kDegenerate, "the fit of the {} model failed: {}", Name(model),
                summary.message);
  }
  LightDescent descent{.light = unknowns.AsLight(start, model),
                       .iterations = static_cast<int>(summary.iterations.size())};
  if (with_covariance) {
    const Result<Eigen::MatrixXd> covariance = CovarianceOf(problem);
    if (!covariance) {
      return tl::unexpected(covariance.error());
    }
    descent.covariance = covariance->topLeftCorner(6, 6);
  }
  return descent;
}

}  // namespace sateen
