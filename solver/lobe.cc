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

constexpr int kLobeSteps = 12;
constexpr int kHalvings = 4;
constexpr double kLobeConverged = 1e-6;  // of |N|
// A lobe is believed where it explains this share of the pixels that it is looked for on.
constexpr double kLobeExplains = 0.7;
// ... and takes at least a fifth off their misfits: chance takes a twentieth.
constexpr double kLobeImproves = 0.8;
// No misfit counts for more than this many limits: outliers are not the lobe's to explain.
constexpr double kMostOverLimit = 4.0;
constexpr std::array kAlphas = {0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.85};
constexpr std::array kStrengths = {0.35, 0.7, 1.4, 2.8};
constexpr std::array kYarnAlphas = {0.2, 0.35, 0.5};
constexpr std::array kYarnRatios = {0.3, 0.55};
constexpr std::array kYarnStrengths = {0.7, 1.4};
constexpr std::array kYarnAzimuthsDeg = {0.0, 22.5, 45.0, 67.5};
constexpr double kLeastAlpha = 0.1;
constexpr int kRefinements = 6;
constexpr double kAlphaStep = 0.05;
constexpr double kAzimuthStepDeg = 8.0;
constexpr size_t kCoarseStep = 4;  // of the pixels, on the grid of roughness and strength
// Steps of the search; roughness and strength also together, because they make up for each other along a
// narrow valley.
struct LobeMove {
  int alpha = 0;
  int strength = 0;
  int along = 0;
  int azimuth = 0;
};
constexpr std::array<LobeMove, 14> kLobeMoves = {{{1, 0},
                                                  {-1, 0},
                                                  {0, 1},
                                                  {0, -1},
                                                  {1, -1},
                                                  {-1, 1},
                                                  {1, 1},
                                                  {-1, -1},
                                                  {0, 0, 1},
                                                  {0, 0, -1},
                                                  {0, 1, 1},
                                                  {0, -1, -1},
                                                  {0, 0, 0, 1},
                                                  {0, 0, 0, -1}}};

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
    const LobeTerm term = LobeTermOf(lobe, n, samples.l.row(k).transpose(), samples.v,
                                     samples.halves[static_cast<size_t>(k)]);
    terms.values[k] = term.value;
    terms.gradients.row(k) = term.gradient.transpose();
  }
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

Eigen::Vector3d LeastSquares(const LobeSamples& samples, const Lobe& /*lobe*/) {
  return (samples.l.transpose() * samples.l).ldlt().solve(samples.l.transpose() * samples.i.col(3));
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

bool Believed(const Score& score) {
  return static_cast<double>(score.explained) >= kLobeExplains * static_cast<double>(score.count);
}

// The lobe changed by so many steps of its figures.
Lobe Moved(const Lobe& lobe, const LobeMove& by, double step) {
  Lobe moved = lobe;
  moved.alpha = std::clamp(lobe.alpha + by.alpha * kAlphaStep * step, kLeastAlpha, 1.0);
  moved.strength = lobe.strength * std::pow(2.0, 0.5 * by.strength * step);
  if (lobe.model == LobeModel::kGgxAnisotropic) {
    moved.alpha_along =
        std::clamp(lobe.alpha_along * std::pow(2.0, 0.5 * by.along * step), kLeastAlpha / 2.0, 1.0);
    moved.azimuth_deg = lobe.azimuth_deg + by.azimuth * kAzimuthStepDeg * step;
  }
  return moved;
}

// From `best` on a grid to the least sum over all pixels: half way to the neighbours, and so on.
void Refine(const std::vector<LobeSamples>& pixels, int threads, Lobe& best, Score& least) {
  least = ScoreOf(best, pixels, 1, threads);
  double step = 1.0;
  for (int j = 0; j < kRefinements; ++j, step *= 0.5) {
    for (bool has_moved = true; has_moved;) {
      has_moved = false;
      const Lobe at = best;
      for (const LobeMove& move : kLobeMoves) {
        if (at.model != LobeModel::kGgxAnisotropic && (move.along != 0 || move.azimuth != 0)) {
          continue;
        }
        const Lobe lobe = Moved(at, move, step);
        const Score score = ScoreOf(lobe, pixels, 1, threads);
        if (score.sum < least.sum) {
          least = score;
          best = lobe;
          has_moved = true;
        }
      }
    }
  }
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

// From the first of three starts that ends within the limit, or the best.
LobeFit FitLobe(const LobeSamples& samples, const Lobe& lobe, double limit) {
  LobeFit fit;
  for (const auto& start : {LeastSquares, DarkerHalf, MirrorOfBrightest}) {
    if (!(fit.chi_squared <= limit)) {
      LobeFit other = FitFrom(start(samples, lobe), samples, lobe);
      if (other.chi_squared < fit.chi_squared) {
        fit = std::move(other);
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

LobeSamples LobeSamplesOf(const PixelSystem& system, const StackNoise& noise,
                          const Eigen::Vector3d& v, double limit) {
  const Eigen::MatrixX3d l = system.L();
  const Eigen::Matrix<double, 3, 4> n0 =
      (l.transpose() * l).ldlt().solve(l.transpose() * system.Rhs());
  return {l, system.Rhs(), LuminanceWeightsOf(system, noise, n0), v, limit};
}

LobeAnswer SolveLobe(const LobeSamples& samples, const Lobe& lobe) {
  const Eigen::MatrixX3d& l = samples.l;
  const Eigen::MatrixX4d& i = samples.i;
  if (l.rows() < kFewestForLobe) {
    return {};
  }
  const auto freedom = static_cast<double>(l.rows() - 3);
  LobeFit fit = FitLobe(samples, lobe, samples.limit * freedom);
  if (lobe.model == LobeModel::kGgxAnisotropic) {
    Lobe crossed = lobe;
    crossed.azimuth_deg += 90.0;
    LobeFit other = FitLobe(samples, crossed, samples.limit * freedom);
    if (other.chi_squared < fit.chi_squared) {
      fit = std::move(other);
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
  for (const LobeModel model : {LobeModel::kCloth, LobeModel::kGgx}) {
    for (const double alpha : kAlphas) {
      for (const double strength : kStrengths) {
        attempt({.model = model, .alpha = alpha, .strength = strength}, kCoarseStep);
      }
    }
  }
  Refine(pixels, threads, best, least);
  if (!Believed(least)) {
    // Yarns: from gloss that is twice as rough across them as along.
    const Lobe round = best;
    const Score of_round = least;
    least.sum = std::numeric_limits<double>::infinity();
    for (const double alpha : kYarnAlphas) {
      for (const double ratio : kYarnRatios) {
        for (const double strength : kYarnStrengths) {
          for (const double azimuth_deg : kYarnAzimuthsDeg) {
            attempt({LobeModel::kGgxAnisotropic, alpha, strength, ratio * alpha, azimuth_deg},
                    kCoarseStep);
          }
        }
      }
    }
    Refine(pixels, threads, best, least);
    if (of_round.sum <= least.sum) {
      best = round;
      least = of_round;
    }
  }
  const Score without = ScoreOf({.alpha = kAlphas.front(), .strength = 0.0}, pixels, 1, threads);
  best.azimuth_deg = std::fmod(best.azimuth_deg + 360.0, 180.0);
  return Believed(least) && least.sum < kLobeImproves * without.sum ? std::optional(best)
                                                                    : std::nullopt;
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
