#include "solver/lobe.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>
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
constexpr double kLobeConverged = 1e-6;  // of chi^2
constexpr double kLeastBody = 0.05;      // of least squares', to start from
// A lobe is believed where it explains this share of the pixels that it is looked for on.
constexpr double kLobeExplains = 0.7;
// ... and takes at least a fifth off their misfits: chance takes a twentieth.
constexpr double kLobeImproves = 0.8;
// On the grid, which may miss its best figures, a tenth.
constexpr double kCoarseImproves = 0.9;
// What a pixel counts for at most.
constexpr double kMostOfAPixel = 20.0;
constexpr std::array kAlphas = {0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.85};
constexpr std::array kStrengths = {0.35, 0.7, 1.4, 2.8};
constexpr std::array kYarnAlphas = {0.2, 0.35, 0.5};
constexpr std::array kYarnRatios = {0.3, 0.55};
constexpr std::array kYarnStrengths = {0.7, 1.4};
constexpr std::array kYarnAzimuthsDeg = {0.0, 22.5, 45.0, 67.5};
constexpr double kLeastAlpha = 0.1;
constexpr int kRefinements = 7;
constexpr int kCoarseRefinements = 3;  // over as many pixels as on the grid
constexpr double kAlphaStep = 0.05;
constexpr double kAzimuthStepDeg = 8.0;
constexpr size_t kCoarseStep = 4;  // of the pixels, on the grid
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

// The pixel at N: chi^2 = sum_k w_k r_k^2, J^T W J and J^T W r.
struct Evaluation {
  double chi_squared = 0.0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

Evaluation EvaluateAt(const LobeSamples& samples, const LobeShape& shape,
                      const Eigen::Vector3d& n) {
  const double length = n.norm();
  const Eigen::Vector3d unit = n / length;
  Evaluation sums;
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    const Eigen::Vector3d l = samples.l.row(k).transpose();
    const LobeTerm s = shape.At(unit, l, samples.v, samples.halves[static_cast<size_t>(k)]);
    // Of s(N / |N|) by N: what of the gradient is across N, over |N|.
    const Eigen::Vector3d j = l + (s.gradient - s.gradient.dot(unit) * unit) / length;
    const double r = samples.i(k, 3) - l.dot(n) - s.value;
    const double w = samples.weights[k];
    sums.chi_squared += w * r * r;
    sums.information.noalias() += w * j * j.transpose();
    sums.gradient += w * r * j;
  }
  return sums;
}

// (13) under each light.
Eigen::VectorXd TermsAt(const LobeSamples& samples, const LobeShape& shape,
                        const Eigen::Vector3d& unit) {
  Eigen::VectorXd s(samples.l.rows());
  for (Eigen::Index k = 0; k < samples.l.rows(); ++k) {
    s[k] = shape.At(unit, samples.l.row(k).transpose(), samples.v,
                    samples.halves[static_cast<size_t>(k)])
               .value;
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

// (15) over every `step`th of the pixels, and how many are explained.
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
    score.sum += std::min(std::log1p(misfit), kMostOfAPixel);
    score.explained += misfit <= 1.0 ? 1 : 0;
  }
  return score;
}

// N where Gauss-Newton ends, and what the pixel is there.
struct LobeFit {
  Eigen::Vector3d n = Eigen::Vector3d::Zero();  // zero: no answer
  Evaluation at{.chi_squared = std::numeric_limits<double>::infinity()};
  const LobeShape* shape = nullptr;
};

// (14)
LobeFit FitFrom(const Eigen::Vector3d& start, const LobeSamples& samples, const LobeShape& shape) {
  LobeFit fit{.shape = &shape};
  if (!start.allFinite() || start.isZero()) {
    return fit;
  }
  fit.n = start;
  fit.at = EvaluateAt(samples, shape, start);
  for (int step = 0; step < kLobeSteps; ++step) {
    const double before = fit.at.chi_squared;
    Eigen::Vector3d move = fit.at.information.ldlt().solve(fit.at.gradient);
    for (int half = 0; half <= kHalvings && move.allFinite(); ++half, move *= 0.5) {
      const Evaluation next = EvaluateAt(samples, shape, fit.n + move);
      if (next.chi_squared < before) {
        fit.n += move;
        fit.at = next;
        break;
      }
    }
    if (!(fit.at.chi_squared < (1.0 - kLobeConverged) * before)) {
      break;
    }
  }
  return fit;
}

Eigen::Vector3d LeastSquares(const LobeSamples& samples, const LobeShape& /*shape*/) {
  return (samples.l.transpose() * samples.l).ldlt().solve(samples.l.transpose() * samples.i.col(3));
}

// Least squares of the darker half of the samples, at least four.
Eigen::Vector3d DarkerHalf(const LobeSamples& samples, const LobeShape& /*shape*/) {
  std::vector<Eigen::Index> order(static_cast<size_t>(samples.l.rows()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](Eigen::Index k) { return samples.i(k, 3); });
  order.resize(std::max<size_t>(4, order.size() / 2));
  const Eigen::MatrixX3d l = samples.l(order, Eigen::all);
  const Eigen::VectorXd i = samples.i(order, 3);
  return (l.transpose() * l).ldlt().solve(l.transpose() * i);
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

// The lobe of least sum: on a grid over some of the pixels, then half way to its neighbours over all, and so on.
class LobeSearch {
 public:
  LobeSearch(const std::vector<LobeSamples>& pixels, int threads)
      : pixels_(pixels), threads_(threads) {}

  void Attempt(const Lobe& lobe) { Take(lobe, kCoarseStep); }

  // False where what was attempted since the last call leads to no lobe that is believed.
  bool Refine() {
    const Lobe nothing{.alpha = kAlphas.front(), .strength = 0.0};
    const double coarse = least_.sum;
    if (coarse > kCoarseImproves * ScoreOf(nothing, pixels_, kCoarseStep, threads_).sum) {
      least_ = {.sum = std::numeric_limits<double>::infinity()};
      return false;
    }
    double step = 1.0;
    for (int j = 0; j < kRefinements; ++j, step *= 0.5) {
      const size_t pixel_step = j < kCoarseRefinements ? kCoarseStep : 1;
      least_ = ScoreOf(best_, pixels_, pixel_step, threads_);
      while (StepToNeighbours(step, pixel_step)) {
      }
    }
    const Score refined = std::exchange(least_, {.sum = std::numeric_limits<double>::infinity()});
    return refined.sum < kLobeImproves * ScoreOf(nothing, pixels_, 1, threads_).sum &&
           static_cast<double>(refined.explained) >=
               kLobeExplains * static_cast<double>(refined.count);
  }

  [[nodiscard]] Lobe Best() const {
    Lobe lobe = best_;
    lobe.azimuth_deg = std::fmod(lobe.azimuth_deg + 360.0, 180.0);
    return lobe;
  }

 private:
  bool Take(const Lobe& lobe, size_t pixel_step) {
    const Score score = ScoreOf(lobe, pixels_, pixel_step, threads_);
    if (!(score.sum < least_.sum)) {
      return false;
    }
    least_ = score;
    best_ = lobe;
    return true;
  }

  bool StepToNeighbours(double step, size_t pixel_step) {
    const Lobe at = best_;
    const bool is_of_yarns = at.model == LobeModel::kGgxAnisotropic;
    bool has_moved = false;
    for (const LobeMove& move : kLobeMoves) {
      if (is_of_yarns || (move.along == 0 && move.azimuth == 0)) {
        has_moved |= Take(Moved(at, move, step), pixel_step);
      }
    }
    return has_moved;
  }

  const std::vector<LobeSamples>& pixels_;
  int threads_;
  Lobe best_;
  Score least_{.sum = std::numeric_limits<double>::infinity()};
};

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

// From the first of three starts that ends within the limit, or the best.
LobeFit FitLobe(const LobeSamples& samples, std::span<const LobeShape> shapes) {
  const double limit = samples.limit * static_cast<double>(samples.l.rows() - 3);
  LobeFit fit;
  for (const auto& start : {LeastSquares, DarkerHalf, MirrorOfBrightest}) {
    for (const LobeShape& shape : shapes) {
      if (!(fit.at.chi_squared <= limit)) {
        const LobeFit other = FitFrom(start(samples, shape), samples, shape);
        if (other.at.chi_squared < fit.at.chi_squared) {
          fit = other;
        }
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
  Lobe crossed = lobe;
  crossed.azimuth_deg += 90.0;
  const std::array<LobeShape, 2> shapes = {LobeShape(lobe), LobeShape(crossed)};
  const LobeFit fit = FitLobe(
      samples, std::span(shapes).first(lobe.model == LobeModel::kGgxAnisotropic ? 2 : 1));
  LobeAnswer answer;
  const double length = fit.n.norm();
  if (!std::isfinite(fit.at.chi_squared) || !(length > 0.0)) {
    return answer;
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
  answer.residual =
      (i.col(3) - s - l * fit.n).norm() / std::sqrt(static_cast<double>(l.rows()));
  answer.misfit = fit.at.chi_squared / static_cast<double>(l.rows() - 3);
  const Eigen::Matrix3d covariance = fit.at.information.inverse();
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
  LobeSearch search(pixels, threads);
  for (const LobeModel model : {LobeModel::kCloth, LobeModel::kGgx}) {
    for (const double alpha : kAlphas) {
      for (const double strength : kStrengths) {
        search.Attempt({.model = model, .alpha = alpha, .strength = strength});
      }
    }
  }
  if (!search.Refine()) {
    for (const double alpha : kYarnAlphas) {
      for (const double ratio : kYarnRatios) {
        for (const double strength : kYarnStrengths) {
          for (const double azimuth_deg : kYarnAzimuthsDeg) {
            search.Attempt(
                {LobeModel::kGgxAnisotropic, alpha, strength, ratio * alpha, azimuth_deg});
          }
        }
      }
    }
    if (!search.Refine()) {
      return std::nullopt;
    }
  }
  return search.Best();
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
