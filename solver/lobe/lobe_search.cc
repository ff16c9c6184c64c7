#include "solver/lobe/lobe_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/check.h"
#include "core/parallel.h"

namespace sateen {
namespace {

// Smallest share of the pixels that a believed lobe explains.
constexpr double kLobeExplains = 0.7;
// Largest sum (1) under a believed lobe, relative to the sum without: chance takes a twentieth off.
constexpr double kLobeImproves = 0.8;
// Largest relative sum on the grid, which may miss the best parameters.
constexpr double kCoarseImproves = 0.9;
// Largest term of (1).
constexpr double kMostOfAPixel = 20.0;
constexpr std::array kAlphas = {0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8};
constexpr std::array kStrengths = {0.35, 0.7, 1.4, 2.8};
constexpr std::array kYarnAlphas = {0.2, 0.35, 0.5};
constexpr std::array kYarnRatios = {0.3, 0.55};
constexpr std::array kYarnStrengths = {0.7, 1.4};
constexpr std::array kYarnAzimuthsDeg = {0.0, 22.5, 45.0, 67.5};
constexpr double kLeastAlpha = 0.1;
constexpr double kMostFuzzAlpha = 0.85;
constexpr double kMostGlossAlpha = 0.7;
constexpr double kLeastStrength = 0.15;
constexpr double kMostStrength = 3.0;
constexpr size_t kFewestPixelsForLobe = 64;
constexpr int kMostMoves = 12;  // per step size
constexpr int kShareSteps = 20;
constexpr int kRefinements = 7;
constexpr int kCoarseRefinements = 3;  // over the pixels of the grid alone
constexpr double kAlphaStep = 0.05;
constexpr double kAzimuthStepDeg = 8.0;
constexpr size_t kCoarseStep = 4;  // on the grid: every fourth pixel

// A step of the search. Some change roughness and strength together, because these compensate each
// other along a narrow valley.
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

// Sum (1) over every `step`th pixel, and the number of pixels explained.
struct Score {
  std::vector<double> misfits;  // relative to their limits
  double sum = 0.0;
  size_t explained = 0;
  size_t count = 0;
};

Score ScoreOf(const Lobe& lobe, const std::vector<LobeSamples>& pixels, size_t step, int threads) {
  Score score;
  score.count = (pixels.size() + step - 1) / step;
  score.misfits.resize(score.count);
  const Status done =
      ParallelFor(static_cast<int>(score.count), 8, {.threads = threads}, [&](int begin, int end) {
        for (auto j = static_cast<size_t>(begin); j < static_cast<size_t>(end); ++j) {
          const LobeSamples& pixel = pixels[j * step];
          const LobeAnswer answer = SolveLobe(pixel, lobe);
          score.misfits[j] = answer.n.isZero() ? std::numeric_limits<double>::infinity()
                                               : answer.misfit / pixel.limit;
        }
      });
  SATEEN_CHECK(done.has_value());
  for (const double misfit : score.misfits) {
    score.sum += std::min(std::log1p(misfit), kMostOfAPixel);
    score.explained += misfit <= 1.0 ? 1 : 0;
  }
  return score;
}

double MostAlpha(LobeModel model) {
  return model == LobeModel::kCloth ? kMostFuzzAlpha : kMostGlossAlpha;
}

bool IsWithinBounds(const Lobe& lobe) {
  return lobe.strength > kLeastStrength && lobe.strength < kMostStrength &&
         lobe.alpha < MostAlpha(lobe.model);
}

// Returns the lobe with its parameters changed by steps.
Lobe Moved(const Lobe& lobe, const LobeMove& by, double step) {
  Lobe moved = lobe;
  moved.alpha =
      std::clamp(lobe.alpha + by.alpha * kAlphaStep * step, kLeastAlpha, MostAlpha(lobe.model));
  moved.strength = std::clamp(lobe.strength * std::pow(2.0, 0.5 * by.strength * step),
                              kLeastStrength, kMostStrength);
  if (lobe.model == LobeModel::kGgxAnisotropic) {
    moved.alpha_along =
        std::clamp(lobe.alpha_along * std::pow(2.0, 0.5 * by.along * step), kLeastAlpha / 2.0, 1.0);
    moved.azimuth_deg = lobe.azimuth_deg + by.azimuth * kAzimuthStepDeg * step;
  }
  return moved;
}

const Score kWorst{.sum = std::numeric_limits<double>::infinity()};

// Finds the lobe with the least sum: on a grid over some of the pixels, then in halving steps to
// its neighbours over all of them.
class LobeSearch {
 public:
  LobeSearch(const std::vector<LobeSamples>& pixels, int threads)
      : pixels_(pixels), threads_(threads) {}

  void Attempt(const Lobe& lobe) { Take(lobe, kCoarseStep); }

  // Returns false where the attempts since the last call lead to no lobe that is believed.
  bool Refine() {
    const Lobe nothing{.alpha = kAlphas.front(), .strength = 0.0};
    const double coarse = least_.sum;
    if (coarse > kCoarseImproves * ScoreOf(nothing, pixels_, kCoarseStep, threads_).sum) {
      least_ = kWorst;
      return false;
    }
    double step = 1.0;
    for (int j = 0; j < kRefinements; ++j, step *= 0.5) {
      const size_t pixel_step = j < kCoarseRefinements ? kCoarseStep : 1;
      least_ = ScoreOf(best_, pixels_, pixel_step, threads_);
      for (int moves = 0; moves < kMostMoves && StepToNeighbours(step, pixel_step); ++moves) {
      }
    }
    const Score refined = std::exchange(least_, kWorst);
    const Score without = ScoreOf(nothing, pixels_, 1, threads_);
    best_.share = ShareOf(refined.misfits, without.misfits);
    return IsWithinBounds(best_) && refined.sum < kLobeImproves * without.sum &&
           2 * (refined.count - refined.explained) <= without.count - without.explained &&
           static_cast<double>(refined.explained) >=
               kLobeExplains * static_cast<double>(refined.count);
  }

  [[nodiscard]] Lobe Best() const {
    Lobe lobe = best_;
    lobe.azimuth_deg -= 180.0 * std::floor(lobe.azimuth_deg / 180.0);
    return lobe;
  }

 private:
  // Returns the share of the pixels that have the lobe, by expectation maximisation: each pixel has
  // it with the probability (3) of solver/lobe/lobe.h. Pixels that neither answer explains do not
  // count.
  [[nodiscard]] double ShareOf(const std::vector<double>& with,
                               const std::vector<double>& without) const {
    double share = 0.5;
    for (int step = 0; step < kShareSteps; ++step) {
      double sum = 0.0;
      double count = 0.0;
      for (size_t j = 0; j < with.size(); ++j) {
        if (std::min(with[j], without[j]) <= 1.0) {
          sum += LobeProbability(without[j] * pixels_[j].limit, with[j] * pixels_[j].limit,
                                 static_cast<int>(pixels_[j].l.rows()) - 3, share);
          count += 1.0;
        }
      }
      share = count > 0.0 ? std::clamp(sum / count, kLeastShare, 1.0 - kLeastShare) : 0.5;
    }
    return share;
  }

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
  Score least_ = kWorst;
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

}  // namespace

std::optional<Lobe> SearchLobe(const std::vector<LobeSamples>& pixels, int threads) {
  if (pixels.size() < kFewestPixelsForLobe) {
    return std::nullopt;
  }
  LobeSearch search(pixels, threads);
  for (const LobeModel model : {LobeModel::kCloth, LobeModel::kGgx}) {
    for (const double alpha : kAlphas) {
      for (const double strength : kStrengths) {
        if (alpha >= MostAlpha(model)) {
          continue;
        }
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

std::optional<Lobe> FindLobe(const FramesInput& input, const LambertianOptions& options,
                             const StackNoise& noise, double scale_squared,
                             const MisfitSample& sample, const std::array<float, 256>& limit,
                             int threads) {
  if (LeastSquaresExplain(sample, limit) || !std::isfinite(scale_squared)) {
    return std::nullopt;
  }
  std::vector<size_t> fit_for_it;
  for (size_t j = 0; j < sample.pixels.size(); ++j) {
    if (sample.samples[j] >= kFewestForLobe) {
      fit_for_it.push_back(j);
    }
  }
  const auto width = static_cast<size_t>(input.stack[0].rgb[0].width);
  PixelSystem system(input, options);
  std::vector<LobeSamples> pixels;
  const size_t step = std::max<size_t>(1, fit_for_it.size() / kLobePixels);
  for (size_t at = 0; at < fit_for_it.size(); at += step) {
    const size_t j = fit_for_it[at];
    const auto column = static_cast<int>(sample.pixels[j] % width);
    const auto row = static_cast<int>(sample.pixels[j] / width);
    if (const std::optional<Eigen::Vector3d> v = ViewOf(input.rig, column, row)) {
      system.Gather(column, row);
      pixels.push_back(LobeSamplesOf(system, noise, scale_squared, *v,
                                     static_cast<double>(limit[sample.samples[j]])));
    }
  }
  return SearchLobe(pixels, threads);
}

}  // namespace sateen
