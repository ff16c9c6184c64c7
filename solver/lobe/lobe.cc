#include "solver/lobe/lobe.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/angle.h"
#include "core/gauss_newton.h"
#include "core/linear_algebra.h"
#include "imaging/color.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr GaussNewtonOptions kLobeSteps = {
    .rule = StepRule::kHalving, .max_iterations = 12, .max_attempts = 5, .min_relative_fall = 1e-6};
constexpr double kLeastBody = 0.05;  // to start from, relative to that of least squares

// Returns chi^2 of a pixel at N, J^T W J and J^T W r.
NormalEquations<3> EvaluateAt(const LobeSamples& samples, const LobeShape& shape,
                              const Eigen::Vector3d& n) {
  const double length = n.norm();
  const Eigen::Vector3d unit = n / length;
  NormalEquations<3> sums;
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    const Eigen::Vector3d l = samples.l.row(k).transpose();
    const LobeTerm s = shape.At(unit, l, samples.v, samples.halves[static_cast<size_t>(k)]);
    // d s(N / |N|) / dN is the part of the gradient across N, over |N|.
    const Eigen::Vector3d j = l + (s.gradient - s.gradient.dot(unit) * unit) / length;
    const double r = samples.i(k, 3) - l.dot(n) - s.value;
    sums.Add(j, r, samples.weights[k]);
  }
  return sums;
}

// Returns the s_k of (1).
Eigen::VectorXd TermsAt(const LobeSamples& samples, const LobeShape& shape,
                        const Eigen::Vector3d& unit) {
  Eigen::VectorXd s(samples.l.rows());
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    s[k] = shape
               .At(unit, samples.l.row(k).transpose(), samples.v,
                   samples.halves[static_cast<size_t>(k)])
               .value;
  }
  return s;
}

// Returns 1 / variance of the luminance of each sample, at the brightness that N^0 of least squares
// predicts.
Eigen::VectorXd LuminanceWeightsOf(const PixelSystem& system, const StackNoise& noise,
                                   const Eigen::Matrix<double, 3, 4>& n0) {
  const double length = n0.col(3).norm();
  Eigen::VectorXd weights(system.Count());
  for (Eigen::Index k = 0; k < system.Count(); ++k) {
    const SampleNoise& of_frame = noise[static_cast<size_t>(system.FrameOf(k))];
    const double bright =
        std::max(system.L().row(k).dot(n0.col(3)), static_cast<double>(kLeastCosine) * length);
    double variance = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      const double f = static_cast<double>(kLuminance[c]) / system.E()(k, column);
      const double b = std::max(0.0, n0.col(column).dot(n0.col(3))) / (length * length);
      const double signal = b * bright * system.E()(k, column);
      variance += f * f * (of_frame.shot[c] * signal + of_frame.read[c] * of_frame.read[c]);
    }
    weights[k] = 1.0 / std::max(variance, std::numeric_limits<double>::min());
  }
  return weights;
}

// N at which Gauss-Newton ends, and the pixel's sums there.
struct LobeFit {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // zero: no answer
  double chi_squared = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  const LobeShape* shape = nullptr;
};

// Iterates (2) from `start`.
LobeFit FitFrom(const Eigen::Vector3d& start, const LobeSamples& samples, const LobeShape& shape) {
  if (!start.allFinite() || start.isZero()) {
    return {.shape = &shape};
  }
  const auto evaluate = [&](const Eigen::Vector3d& n) { return EvaluateAt(samples, shape, n); };
  const auto move = [](const Eigen::Vector3d& n, const Eigen::Vector3d& step) -> Eigen::Vector3d {
    return n + step;
  };
  const GaussNewtonFit<3, Eigen::Vector3d> fit =
      MinimizeSquares<3>(start, evaluate, move, kLobeSteps);
  return {fit.state, fit.equations.cost, fit.equations.information, &shape};
}

Eigen::Vector3d LeastSquares(const LobeSamples& samples, const LobeShape& /*shape*/) {
  return SolveNormalEquations(samples.l, Eigen::VectorXd(samples.i.col(3)));
}

// Solves least squares of the darker half of the samples, at least four.
Eigen::Vector3d DarkerHalf(const LobeSamples& samples, const LobeShape& /*shape*/) {
  std::vector<Eigen::Index> order(static_cast<size_t>(samples.l.rows()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](Eigen::Index k) { return samples.i(k, 3); });
  order.resize(std::max<size_t>(4, order.size() / 2));
  const Eigen::MatrixX3d l = samples.l(order, Eigen::all);
  const Eigen::VectorXd i = samples.i(order, 3);
  return SolveNormalEquations(l, i);
}

// Returns the normal that mirrors the brightest lights, times the albedo of the body under it.
Eigen::Vector3d MirrorOfBrightest(const LobeSamples& samples, const LobeShape& shape) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    const double i = std::max(0.0, samples.i(k, 3));
    sum += i * i * samples.halves[static_cast<size_t>(k)].h;
  }
  const Eigen::Vector3d unit = sum.normalized();
  const Eigen::VectorXd cosines = samples.l * unit;
  const double squares = cosines.squaredNorm();
  const double body = cosines.dot(samples.i.col(3) - TermsAt(samples, shape, unit)) / squares;
  return std::max(body, kLeastBody * cosines.dot(samples.i.col(3)) / squares) * unit;
}

// Iterates from the three starts in turn until one of the shapes is within the limit. Returns the
// best.
LobeFit FitLobe(const LobeSamples& samples, std::span<const LobeShape> shapes) {
  const double limit = samples.limit * static_cast<double>(samples.l.rows() - 3);
  LobeFit fit;
  for (const auto& start : {LeastSquares, DarkerHalf, MirrorOfBrightest}) {
    if (fit.chi_squared <= limit) {
      break;
    }
    for (const LobeShape& shape : shapes) {
      const LobeFit other = FitFrom(start(samples, shape), samples, shape);
      if (other.chi_squared < fit.chi_squared) {
        fit = other;
      }
    }
  }
  return fit;
}

}  // namespace

LobeSamples::LobeSamples(Eigen::MatrixX3d directions, Eigen::MatrixX4d samples,
                         Eigen::VectorXd by_variance, const Eigen::Vector3d& to_camera,
                         double misfit_limit)
    : l(std::move(directions)),
      i(std::move(samples)),
      weights(std::move(by_variance)),
      v(to_camera),
      limit(misfit_limit) {
  halves.reserve(static_cast<size_t>(l.rows()));
  for (Eigen::Index k = 0; k < l.rows(); ++k) {
    halves.push_back(LobeHalfOf(l.row(k).transpose(), v));
  }
}

LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise, double scale_squared,
                          const Eigen::Vector3d& v, double limit) {
  const Eigen::MatrixX3d l = system.L();
  const Eigen::Matrix<double, 3, 4> n0 = SolveNormalEquations(l, Eigen::MatrixX4d(system.Rhs()));
  return {l, system.Rhs(), LuminanceWeightsOf(system, noise, n0) / scale_squared, v,
          limit / scale_squared};
}

LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe) {
  const Eigen::MatrixX3d& l = samples.l;
  const Eigen::MatrixX4d& i = samples.i;
  if (l.rows() < kFewestForLobe) {
    return {};
  }
  Lobe crossed = lobe;
  crossed.azimuth_deg += 90.0;
  const std::array<LobeShape, 2> shapes = {LobeShape(lobe), LobeShape(crossed)};
  const LobeFit fit =
      FitLobe(samples, std::span(shapes).first(lobe.model == LobeModel::kGgxAnisotropic ? 2 : 1));
  LobeAnswer answer;
  const double length = fit.n.norm();
  if (!std::isfinite(fit.chi_squared) || !(fit.n.dot(samples.v) > 0.0)) {
    return answer;  // where the surface would face away, too
  }
  answer.n = fit.n;
  const Eigen::Vector3d unit = fit.n / length;
  const Eigen::VectorXd s = TermsAt(samples, *fit.shape, unit);
  const Eigen::VectorXd cosines = l * unit;
  const double squares = cosines.squaredNorm();
  for (Eigen::Index c = 0; c < 3; ++c) {
    answer.albedo[c] = std::max(0.0, cosines.dot(i.col(c) - s) / squares);
  }
  answer.lobe_share = cosines.dot(s) / squares / length;
  answer.residual = (i.col(3) - s - l * fit.n).norm() / std::sqrt(static_cast<double>(l.rows()));
  answer.misfit = fit.chi_squared / static_cast<double>(l.rows() - 3);
  const Eigen::Matrix3d covariance = fit.information.inverse();
  const double along = unit.dot(covariance * unit);
  answer.uncertainty_deg =
      std::sqrt(std::max(0.0, covariance.trace() - along)) / length * kDegPerRad;
  answer.albedo_uncertainty = std::sqrt(std::max(0.0, along)) / length;
  return answer;
}

double LobeProbability(double misfit_without, double misfit_with, int freedom, double share) {
  const double lead = 0.5 * freedom * (misfit_without - misfit_with) +
                      std::log(share / (1.0 - std::min(share, 1.0 - kLeastShare)));
  return 1.0 / (1.0 + std::exp(std::clamp(-lead, -700.0, 700.0)));
}

std::optional<Eigen::Vector3d> ViewOf(const Rig& rig, int column, int row) {
  if (!rig.camera || !rig.RequirePose("rig")) {
    return std::nullopt;
  }
  const std::optional<Eigen::Vector3d> x_mm = TablePointOfPixel(*rig.camera, column, row);
  if (!x_mm) {
    return std::nullopt;
  }
  return (rig.camera->table_from_camera.translation() - *x_mm).normalized();
}

}  // namespace sateen
