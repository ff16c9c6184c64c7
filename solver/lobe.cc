#include "solver/lobe.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "core/angle.h"
#include "core/check.h"
#include "core/parallel.h"
#include "imaging/color.h"
#include "solver/consensus.h"

namespace sateen {
namespace {

constexpr double kLobeF0 = 0.04;
constexpr double kLeastViewCosine = 1e-4;  // as reflectance/specular.h has it
constexpr double kLeastSineSquared = 1e-4;  // of n and h, below which velvet is flat
constexpr int kLobeSteps = 12;
constexpr int kHalvings = 4;
constexpr double kLobeConverged = 1e-6;  // of |N|
// A lobe is believed where it explains this share of the pixels that it is looked for on.
constexpr double kLobeExplains = 0.7;
// ... and takes at least a fifth off their misfits: chance takes a twentieth.
constexpr double kLobeImproves = 0.8;
// No misfit counts for more than this many limits: outliers are not the lobe's to explain.
constexpr double kMostOverLimit = 4.0;
constexpr std::array kModels = {LobeModel::kCloth, LobeModel::kGgx};
constexpr std::array kAlphas = {0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.85};
constexpr std::array kStrengths = {0.35, 0.7, 1.4, 2.8};
constexpr double kLeastAlpha = 0.1;
constexpr int kRefinements = 6;
constexpr size_t kCoarseStep = 4;  // of the pixels, on the grid of roughness and strength
constexpr std::array<std::pair<int, int>, 8> kNeighbours = {
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, -1}, {-1, 1}, {1, 1}, {-1, -1}}};

// What a pixel has of a lobe under each light: values, and gradients in n as rows.
struct LobeTerms {
  Eigen::VectorXd values;
  Eigen::MatrixX3d gradients;
};

void FillTerms(const LobeSamples& samples, const Lobe& lobe, const Eigen::Vector3d& n,
               LobeTerms& terms) {
  const Eigen::Index count = samples.l.rows();
  terms.values.resize(count);
  terms.gradients.resize(count, 3);
  for (Eigen::Index k = 0; k < count; ++k) {
    const LobeTerm term = LobeTermOf(lobe, n, samples.l.row(k).transpose(), samples.v);
    terms.values[k] = term.value;
    terms.gradients.row(k) = term.gradient.transpose();
  }
}

// A factor of the lobe and its derivative.
struct Factor {
  double value;
  double slope;
};

// reflectance/microfacet.h's VelvetDistribution in n . h.
Factor VelvetOf(double n_h, double alpha) {
  const double unit = 1.0 / (std::numbers::pi * (1.0 + 4.0 * alpha * alpha));
  const double q = 1.0 - n_h * n_h;
  if (q < kLeastSineSquared) {
    return {unit, 0.0};
  }
  const double e = std::exp(-n_h * n_h / (q * alpha * alpha)) / (q * q);
  return {unit * (1.0 + 4.0 * e),
          unit * 4.0 * e * (4.0 * n_h / q - 2.0 * n_h / (alpha * alpha * q * q))};
}

// reflectance/microfacet.h's GgxDistribution in n . h.
Factor GgxOf(double n_h, double alpha) {
  const double a = alpha * alpha;
  const double t = n_h * n_h * (a - 1.0) + 1.0;
  const double d = a / (std::numbers::pi * t * t);
  return {d, -4.0 * d * n_h * (a - 1.0) / t};
}

// x + sqrt(x^2 + alpha^2 (1 - x^2)): Smith's masking is 2 x over this.
Factor SmithOf(double x, double alpha) {
  const double a = alpha * alpha;
  const double root = std::sqrt(x * x * (1.0 - a) + a);
  return {x + root, 1.0 + x * (1.0 - a) / root};
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

// Sum over every `step`th of the pixels of the misfits in limits, none more than kMostOverLimit, and how
// many are explained.
struct Score {
  double sum = 0.0;
  size_t explained = 0;
  size_t count = 0;
};

Score ScoreOf(const Lobe& lobe, const std::vector<LobeSamples>& pixels, size_t step, int threads) {
  Score score;
  score.count = (pixels.size() + step - 1) / step;
  std::vector<double> misfits(score.count);
  const Status done =
      ParallelFor(static_cast<int>(score.count), 8, {.threads = threads}, [&](int begin, int end) {
        for (auto j = static_cast<size_t>(begin); j < static_cast<size_t>(end); ++j) {
          const LobeSamples& pixel = pixels[j * step];
          const LobeAnswer answer = SolveLobe(pixel, lobe);
          misfits[j] = answer.n.isZero() ? std::numeric_limits<double>::infinity()
                                         : answer.misfit / pixel.limit;
        }
      });
  SATEEN_CHECK(done.has_value());
  for (const double misfit : misfits) {
    score.sum += std::min(misfit, kMostOverLimit);
    score.explained += misfit <= 1.0 ? 1 : 0;
  }
  return score;
}

// N where Gauss-Newton ends, its misfit, and what the lobe is there.
struct LobeFit {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // zero: no answer
  double chi_squared = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // J^T W J
  LobeTerms terms;
};

double ChiSquaredAt(const LobeSamples& samples, const Lobe& lobe, const Eigen::Vector3d& n,
                    LobeTerms& terms) {
  FillTerms(samples, lobe, n.normalized(), terms);
  const Eigen::VectorXd r = samples.i.col(3) - samples.l * n - terms.values;
  return r.dot(samples.weights.cwiseProduct(r));
}

// (14)
LobeFit FitFrom(const Eigen::Vector3d& start, const LobeSamples& samples, const Lobe& lobe) {
  LobeFit fit;
  if (!start.allFinite() || start.isZero()) {
    return fit;
  }
  fit.n = start;
  fit.chi_squared = ChiSquaredAt(samples, lobe, fit.n, fit.terms);
  LobeTerms terms;
  for (int step = 0; step < kLobeSteps; ++step) {
    const double length = fit.n.norm();
    const Eigen::Vector3d unit = fit.n / length;
    const Eigen::Matrix3d turn = (Eigen::Matrix3d::Identity() - unit * unit.transpose()) / length;
    const Eigen::MatrixX3d j = samples.l + fit.terms.gradients * turn;
    const Eigen::MatrixX3d weighted = samples.weights.asDiagonal() * j;
    const Eigen::VectorXd r = samples.i.col(3) - samples.l * fit.n - fit.terms.values;
    fit.information = j.transpose() * weighted;
    Eigen::Vector3d move = fit.information.ldlt().solve(weighted.transpose() * r);
    bool better = false;
    for (int half = 0; half <= kHalvings && move.allFinite(); ++half, move *= 0.5) {
      const Eigen::Vector3d next = fit.n + move;
      const double chi_squared = ChiSquaredAt(samples, lobe, next, terms);
      if (chi_squared < fit.chi_squared) {
        fit.n = next;
        fit.chi_squared = chi_squared;
        std::swap(fit.terms, terms);
        better = true;
        break;
      }
    }
    if (!better || move.norm() < kLobeConverged * length) {
      break;
    }
  }
  return fit;
}

// Least squares of the darker half of the samples, at least four.
Eigen::Vector3d DarkerHalf(const LobeSamples& samples, const Lobe& /*lobe*/) {
  std::vector<Eigen::Index> order(static_cast<size_t>(samples.l.rows()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](Eigen::Index k) { return samples.i(k, 3); });
  order.resize(std::max<size_t>(4, order.size() / 2));
  const Eigen::MatrixX3d l = samples.l(order, Eigen::all);
  const Eigen::VectorXd i = samples.i(order, 3);
  return (l.transpose() * l).ldlt().solve(l.transpose() * i);
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

// The normal that mirrors the brightest lights, with the body that the samples leave to it.
Eigen::Vector3d MirrorOfBrightest(const LobeSamples& samples, const Lobe& lobe) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    const double i = std::max(0.0, samples.i(k, 3));
    sum += i * i * (samples.l.row(k).transpose() + samples.v).normalized();
  }
  const Eigen::Vector3d unit = sum.normalized();
  LobeTerms terms;
  FillTerms(samples, lobe, unit, terms);
  const Eigen::VectorXd cosines = samples.l * unit;
  const double body = cosines.dot(samples.i.col(3) - terms.values) / cosines.squaredNorm();
  return std::max(body, 0.05 * cosines.dot(samples.i.col(3)) / cosines.squaredNorm()) * unit;
}

}  // namespace

std::string_view Name(LobeModel model) { return model == LobeModel::kCloth ? "cloth" : "ggx"; }

LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise,
                            const Eigen::Vector3d& v, double limit) {
  LobeSamples samples{.l = system.L(), .i = system.Rhs(), .v = v, .limit = limit};
  const Eigen::Matrix<double, 3, 4> n0 =
      (samples.l.transpose() * samples.l).ldlt().solve(samples.l.transpose() * samples.i);
  samples.weights = LuminanceWeightsOf(system, noise, n0);
  return samples;
}

LobeTerm LobeTermOf(const Lobe& lobe, const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                    const Eigen::Vector3d& v) {
  const double n_l = n.dot(l);
  if (n_l <= 0.0) {
    return {};
  }
  const Eigen::Vector3d h = (l + v).normalized();
  const double v_h = std::clamp(v.dot(h), 0.0, 1.0);
  const double fresnel = kLobeF0 + (1.0 - kLobeF0) * std::pow(1.0 - v_h, 5.0);
  const double n_v = std::max(n.dot(v), kLeastViewCosine);
  const double along_v = n.dot(v) > kLeastViewCosine ? 1.0 : 0.0;  // of the gradient
  const double n_h = std::clamp(n.dot(h), 0.0, 1.0);
  const double unit = lobe.strength * std::numbers::pi * fresnel;
  if (lobe.model == LobeModel::kCloth) {
    const Factor d = VelvetOf(n_h, lobe.alpha);
    const double g = 4.0 * (n_l + n_v - n_l * n_v);
    const double value = unit * d.value * n_l / g;
    return {value, unit * d.slope * n_l / g * h + unit * d.value / g * l -
                       value / g * 4.0 * ((1.0 - n_v) * l + along_v * (1.0 - n_l) * v)};
  }
  const Factor d = GgxOf(n_h, lobe.alpha);
  const Factor of_l = SmithOf(n_l, lobe.alpha);
  const Factor of_v = SmithOf(n_v, lobe.alpha);
  const double visibility = 1.0 / (of_l.value * of_v.value);
  const double value = unit * d.value * visibility * n_l;
  return {value, unit * d.slope * visibility * n_l * h + unit * d.value * visibility * l -
                     value * (of_l.slope / of_l.value * l + along_v * of_v.slope / of_v.value * v)};
}

LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe) {
  const Eigen::MatrixX3d& l = samples.l;
  const Eigen::MatrixX4d& i = samples.i;
  if (l.rows() < kFewestForLobe) {
    return {};
  }
  const auto freedom = static_cast<double>(l.rows() - 3);
  LobeFit fit = FitFrom((l.transpose() * l).ldlt().solve(l.transpose() * i.col(3)), samples, lobe);
  for (const auto& start : {DarkerHalf, MirrorOfBrightest}) {
    if (!(fit.chi_squared <= samples.limit * freedom)) {
      LobeFit other = FitFrom(start(samples, lobe), samples, lobe);
      if (other.chi_squared < fit.chi_squared) {
        fit = std::move(other);
      }
    }
  }
  LobeAnswer answer;
  const double length = fit.n.norm();
  if (!std::isfinite(fit.chi_squared) || !(length > 0.0)) {
    return answer;
  }
  answer.n = fit.n;
  const Eigen::Vector3d unit = fit.n / length;
  const Eigen::VectorXd cosines = l * unit;
  const double squares = cosines.squaredNorm();
  for (Eigen::Index c = 0; c < 3; ++c) {
    answer.albedo[c] = std::max(0.0, cosines.dot(i.col(c) - fit.terms.values) / squares);
  }
  answer.lobe_share = cosines.dot(fit.terms.values) / squares / length;
  const Eigen::VectorXd r = i.col(3) - fit.terms.values - l * fit.n;
  answer.residual = r.norm() / std::sqrt(static_cast<double>(l.rows()));
  answer.misfit = fit.chi_squared / freedom;
  const Eigen::Matrix3d covariance = fit.information.inverse();
  const double along = unit.dot(covariance * unit);
  answer.uncertainty_deg =
      std::sqrt(std::max(0.0, covariance.trace() - along)) / length * kDegPerRad;
  answer.albedo_uncertainty = std::sqrt(std::max(0.0, along)) / length;
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

std::optional<Lobe> SearchLobe(const std::vector<LobeSamples>& pixels, int threads) {
  if (pixels.empty()) {
    return std::nullopt;
  }
  Lobe best;
  Score least{.sum = std::numeric_limits<double>::infinity()};
  const auto attempt = [&](const Lobe& lobe, size_t step) {
    const Score score = ScoreOf(lobe, pixels, step, threads);
    if (score.sum < least.sum) {
      least = score;
      best = lobe;
      return true;
    }
    return false;
  };
  for (const LobeModel model : kModels) {
    for (const double alpha : kAlphas) {
      for (const double strength : kStrengths) {
        attempt({model, alpha, strength}, kCoarseStep);
      }
    }
  }
  least = ScoreOf(best, pixels, 1, threads);
  // Half way to the neighbours on the grid, and so on.
  double alpha_step = 0.05;
  double strength_factor = std::sqrt(2.0);
  for (int j = 0; j < kRefinements; ++j) {
    for (bool moved = true; moved;) {
      moved = false;
      const Lobe at = best;
      // Eight neighbours, because roughness and strength make up for each other along a narrow valley.
      for (const auto& [a, b] : kNeighbours) {
        moved |= attempt({at.model, std::clamp(at.alpha + a * alpha_step, kLeastAlpha, 1.0),
                          at.strength * std::pow(strength_factor, b)},
                         1);
      }
    }
    alpha_step *= 0.5;
    strength_factor = std::sqrt(strength_factor);
  }
  const Score without = ScoreOf({.alpha = kAlphas.front(), .strength = 0.0}, pixels, 1, threads);
  const bool believed =
      least.sum < kLobeImproves * without.sum &&
      static_cast<double>(least.explained) >= kLobeExplains * static_cast<double>(pixels.size());
  return believed ? std::optional(best) : std::nullopt;
}

std::optional<Lobe> FindLobe(const LightStack& stack, const Rig& rig,
                               const LambertianOptions& options, const StackNoise& noise,
                               const MisfitSample& sample, const std::array<float, 256>& limit,
                               int threads) {
  if (LeastSquaresExplain(sample, limit)) {
    return std::nullopt;
  }
  const auto width = static_cast<size_t>(stack[0].rgb[0].width);
  PixelSystem system(stack, rig, options);
  std::vector<LobeSamples> pixels;
  const size_t step = std::max<size_t>(1, sample.pixels.size() / kLobePixels);
  for (size_t j = 0; j < sample.pixels.size(); j += step) {
    const auto column = static_cast<int>(sample.pixels[j] % width);
    const auto row = static_cast<int>(sample.pixels[j] / width);
    const std::optional<Eigen::Vector3d> v = ViewOf(rig, column, row);
    if (v && sample.samples[j] >= kFewestForLobe) {
      system.Gather(column, row);
      pixels.push_back(
          LobeSamplesOf(system, noise, *v, static_cast<double>(limit[sample.samples[j]])));
    }
  }
  return SearchLobe(pixels, threads);
}

}  // namespace sateen
