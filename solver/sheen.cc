#include "solver/sheen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "core/angle.h"
#include "imaging/color.h"
#include "reflectance/specular.h"
#include "solver/consensus.h"

namespace sateen {
namespace {

constexpr double kSheenF0 = 0.04;
constexpr int kSheenSteps = 8;
constexpr double kSheenConverged = 1e-5;  // of |N|
// A sheen is believed where it explains this share of the pixels that it is looked for on.
constexpr double kSheenExplains = 0.9;
// ... and takes at least a fifth off their misfits: chance takes a twentieth.
constexpr double kSheenImproves = 0.8;
// No misfit counts for more than this many limits: outliers are not the sheen's to explain.
constexpr double kMostOverLimit = 4.0;
constexpr std::array kAlphas = {0.3, 0.4, 0.5, 0.6, 0.75, 0.9};
constexpr std::array kStrengths = {0.35, 0.7, 1.4, 2.8};
constexpr double kLeastAlpha = 0.1;
constexpr int kRefinements = 6;
constexpr std::array<std::pair<int, int>, 8> kNeighbours = {
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, -1}, {-1, 1}, {1, 1}, {-1, -1}}};

// Equation (13)'s s_k, in units of radiance.
Eigen::VectorXd SheenOf(const SheenSamples& samples, const Sheen& sheen, const Eigen::Vector3d& n) {
  const Cloth cloth({.f0 = Eigen::Vector3d::Constant(kSheenF0), .alpha = sheen.alpha});
  Eigen::VectorXd s(samples.l.rows());
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    const Eigen::Vector3d l = samples.l.row(k).transpose();
    s[k] = sheen.strength * std::numbers::pi * cloth.Evaluate(n, l, samples.v)[0] *
           std::max(0.0, n.dot(l));
  }
  return s;
}

// 1 / variance of the luminance, (1) of its samples at what least squares N^0 predict.
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

// Sum over pixels of the misfits in limits, none more than kMostOverLimit; `explained` counts.
double ScoreOf(const Sheen& sheen, const std::vector<SheenSamples>& pixels, size_t& explained) {
  double score = 0.0;
  explained = 0;
  for (const SheenSamples& pixel : pixels) {
    const SheenAnswer answer = SolveSheen(pixel, sheen);
    const double misfit =
        answer.n.isZero() ? std::numeric_limits<double>::infinity() : answer.misfit / pixel.limit;
    score += std::min(misfit, kMostOverLimit);
    explained += misfit <= 1.0 ? 1 : 0;
  }
  return score;
}

bool LeastSquaresExplain(const MisfitSample& sample, const std::array<float, 256>& limit) {
  size_t checked = 0;
  size_t explained = 0;
  for (size_t j = 0; j < sample.pixels.size(); ++j) {
    checked += sample.samples[j] > 3 ? 1 : 0;
    explained += sample.samples[j] > 3 && sample.misfits[j] <= limit[sample.samples[j]] ? 1 : 0;
  }
  return static_cast<double>(explained) >= kWellExplained * static_cast<double>(checked);
}

}  // namespace

SheenSamples SheenSamplesOf(const PixelSystem& system, const StackNoise& noise,
                            const Eigen::Vector3d& v, double limit) {
  SheenSamples samples{.l = system.L(), .i = system.Rhs(), .v = v, .limit = limit};
  const Eigen::Matrix<double, 3, 4> n0 =
      (samples.l.transpose() * samples.l).ldlt().solve(samples.l.transpose() * samples.i);
  samples.weights = LuminanceWeightsOf(system, noise, n0);
  return samples;
}

SheenAnswer SolveSheen(const SheenSamples& samples, const Sheen& sheen) {
  const Eigen::MatrixX3d& l = samples.l;
  const Eigen::MatrixX4d& i = samples.i;
  const Eigen::VectorXd& w = samples.weights;
  if (l.rows() < kFewestForSheen) {
    return {};
  }
  const Eigen::Matrix3d covariance = (l.transpose() * w.asDiagonal() * l).inverse();
  const Eigen::Matrix3Xd solve = covariance * l.transpose() * w.asDiagonal();
  Eigen::Vector3d n = (l.transpose() * l).ldlt().solve(l.transpose() * i.col(3));
  Eigen::VectorXd s;
  for (int step = 0; step < kSheenSteps; ++step) {  // (14)
    s = SheenOf(samples, sheen, n.normalized());
    const Eigen::Vector3d next = solve * (i.col(3) - s);
    const double moved = (next - n).norm();
    n = next;
    if (!n.allFinite() || n.isZero()) {
      return {};
    }
    if (moved < kSheenConverged * n.norm()) {
      break;
    }
  }
  SheenAnswer answer;
  answer.n = n;
  const Eigen::Vector3d unit = n.normalized();
  s = SheenOf(samples, sheen, unit);
  const Eigen::VectorXd r = i.col(3) - s - l * n;
  const Eigen::VectorXd cosines = l * unit;
  for (Eigen::Index c = 0; c < 3; ++c) {
    answer.albedo[c] = std::max(0.0, cosines.dot(i.col(c) - s) / cosines.squaredNorm());
  }
  answer.residual = r.norm() / std::sqrt(static_cast<double>(l.rows()));
  answer.misfit = r.dot(w.cwiseProduct(r)) / static_cast<double>(l.rows() - 3);
  const double along = unit.dot(covariance * unit);
  answer.uncertainty_deg =
      std::sqrt(std::max(0.0, covariance.trace() - along)) / n.norm() * kDegPerRad;
  answer.albedo_uncertainty = std::sqrt(along) / n.norm();
  return answer;
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

std::optional<Sheen> SearchSheen(const std::vector<SheenSamples>& pixels) {
  Sheen best;
  size_t explained = 0;
  double least = std::numeric_limits<double>::infinity();
  size_t best_explained = 0;
  const auto attempt = [&](const Sheen& sheen) {
    const double score = ScoreOf(sheen, pixels, explained);
    if (score < least) {
      least = score;
      best = sheen;
      best_explained = explained;
      return true;
    }
    return false;
  };
  for (const double alpha : kAlphas) {
    for (const double strength : kStrengths) {
      attempt({alpha, strength});
    }
  }
  // Half way to the neighbours on the grid, and so on.
  double alpha_step = 0.05;
  double strength_factor = std::sqrt(2.0);
  for (int j = 0; j < kRefinements; ++j) {
    for (bool moved = true; moved;) {
      moved = false;
      const Sheen at = best;
      // Eight neighbours, because roughness and strength make up for each other along a narrow valley.
      for (const auto& [a, b] : kNeighbours) {
        moved |= attempt({std::clamp(at.alpha + a * alpha_step, kLeastAlpha, 1.0),
                          at.strength * std::pow(strength_factor, b)});
      }
    }
    alpha_step *= 0.5;
    strength_factor = std::sqrt(strength_factor);
  }
  const double without = ScoreOf({.alpha = kAlphas.front(), .strength = 0.0}, pixels, explained);
  const bool believed =
      !pixels.empty() && least < kSheenImproves * without &&
      static_cast<double>(best_explained) >= kSheenExplains * static_cast<double>(pixels.size());
  return believed ? std::optional(best) : std::nullopt;
}

std::optional<Sheen> FindSheen(const LightStack& stack, const Rig& rig,
                               const LambertianOptions& options, const StackNoise& noise,
                               const MisfitSample& sample, const std::array<float, 256>& limit) {
  if (LeastSquaresExplain(sample, limit)) {
    return std::nullopt;
  }
  const auto width = static_cast<size_t>(stack[0].rgb[0].width);
  PixelSystem system(stack, rig, options);
  std::vector<SheenSamples> pixels;
  const size_t step = std::max<size_t>(1, sample.pixels.size() / kSheenPixels);
  for (size_t j = 0; j < sample.pixels.size(); j += step) {
    const auto column = static_cast<int>(sample.pixels[j] % width);
    const auto row = static_cast<int>(sample.pixels[j] / width);
    const std::optional<Eigen::Vector3d> v = ViewOf(rig, column, row);
    if (v && sample.samples[j] >= kFewestForSheen) {
      system.Gather(column, row);
      pixels.push_back(
          SheenSamplesOf(system, noise, *v, static_cast<double>(limit[sample.samples[j]])));
    }
  }
  return SearchSheen(pixels);
}

}  // namespace sateen
