#include "solver/robust/consensus.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "solver/least_squares/weighted.h"

namespace sateen {
namespace {

// Returns the spread of (6) for a variance of VariancesOf().
double SpreadOf(double variance, double mean_square) {
  return std::hypot(static_cast<double>(kUncertaintyFactor) * std::sqrt(variance * mean_square),
                    static_cast<double>(kLeastModelUncertainty));
}

// Samples of a pixel in order of brightness, in medians.
struct RankedSamples {
  std::vector<Eigen::Index> order;  // all usable ones
  size_t begin = 0;                 // of the band
  size_t end = 0;
  double median = 0.0;
  Eigen::MatrixX4d i;  // the last column is j
  Eigen::Vector3d w;   // of (1)
};

// Returns the w of (1), or the luminance's where the pixel is grey.
Eigen::Vector3d ChromaOf(const PixelSystem& system) {
  const Eigen::Vector3d sum = system.Rhs().leftCols<3>().colwise().sum().transpose();
  const Eigen::Vector3d chroma = sum.array() - sum.mean();
  return chroma.norm() > static_cast<double>(kLeastChroma) * sum.norm()
             ? Eigen::Vector3d(chroma * LuminanceWeights().dot(sum) / chroma.squaredNorm())
             : LuminanceWeights();
}

RankedSamples Ranked(const PixelSystem& system, const Eigen::Vector3d& w) {
  RankedSamples ranked;
  ranked.w = w;
  ranked.i = system.Rhs();
  ranked.i.col(3) = ranked.i.leftCols<3>() * ranked.w;
  const double shadow = system.ShadowLevel() * ranked.i.col(3).maxCoeff();
  for (Eigen::Index k = 0; k < system.Count(); ++k) {
    if (ranked.i(k, 3) > shadow) {
      ranked.order.push_back(k);
    }
  }
  std::ranges::stable_sort(ranked.order, {}, [&](Eigen::Index k) { return ranked.i(k, 3); });
  const size_t count = ranked.order.size();
  if (count < 3) {
    ranked.order.clear();
    return ranked;
  }
  ranked.median = ranked.i(ranked.order[(count - 1) / 2], 3);
  ranked.i /= ranked.median;
  while (ranked.begin < count &&
         ranked.i(ranked.order[ranked.begin], 3) <= static_cast<double>(kDarkOfMedian)) {
    ++ranked.begin;
  }
  if (count - ranked.begin < kFewestAgreeing) {
    ranked.begin = 0;
  }
  const double beyond =
      std::max(0.0, static_cast<double>(count - ranked.begin) - kUntrimmedSamples);
  ranked.begin += static_cast<size_t>(std::floor(beyond * static_cast<double>(kTrimDark)));
  ranked.end = count - static_cast<size_t>(std::floor(beyond * static_cast<double>(kTrimBright)));
  return ranked;  // (2)
}

std::vector<Eigen::Index> TripleSamplesOf(const RankedSamples& ranked) {
  const size_t in_band = ranked.end - ranked.begin;
  std::vector<Eigen::Index> picked;
  for (size_t j = 0; j < std::min<size_t>(in_band, kTripleSamples); ++j) {
    const double spaced =
        static_cast<double>(in_band - 1) * static_cast<double>(j) / (kTripleSamples - 1);
    const size_t place =
        in_band <= kTripleSamples ? j : static_cast<size_t>(std::floor(spaced + 0.5));
    picked.push_back(ranked.order[ranked.begin + place]);
  }
  return picked;
}

// Finds the N of (3) and (4) and returns the logarithm of its product. `n` stays where no triple is
// well conditioned.
double SearchPlainTriples(const PixelSystem& system, const RankedSamples& ranked,
                          const std::vector<Eigen::Index>& picked, Eigen::Vector3d& n) {
  double best = std::numeric_limits<double>::infinity();
  for (size_t a = 0; a < picked.size(); ++a) {
    for (size_t b = a + 1; b < picked.size(); ++b) {
      for (size_t c = b + 1; c < picked.size(); ++c) {
        Eigen::Matrix3d l;
        l << system.L().row(picked[a]), system.L().row(picked[b]), system.L().row(picked[c]);
        if (!(std::abs(l.determinant()) > static_cast<double>(kLeastTripleVolume))) {
          continue;
        }
        const Eigen::Vector3d i(ranked.i(picked[a], 3), ranked.i(picked[b], 3),
                                ranked.i(picked[c], 3));
        const Eigen::Vector3d m = l.inverse() * i;
        double cost = 0.0;
        for (const Eigen::Index k : picked) {
          const double r = ranked.i(k, 3) - system.L().row(k).dot(m);
          cost += std::log1p(std::abs(r) / static_cast<double>(kConsensusScale));
        }
        if (cost < best) {
          best = cost;
          n = m;
        }
      }
    }
  }
  return best;
}

// Sums of (5) and (6).
struct PlainSums {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d b = Eigen::Matrix3d::Zero();
  double weights = 0.0;
  double squares = 0.0;
};

PlainSums SumsAt(const PixelSystem& system, const RankedSamples& ranked, const Eigen::Vector3d& n,
                 bool start) {
  PlainSums sums;
  for (size_t j = ranked.begin; j < ranked.end; ++j) {
    const Eigen::Index k = ranked.order[j];
    const Eigen::Vector3d l = system.L().row(k).transpose();
    const double r = ranked.i(k, 3) - l.dot(n);
    const double t = r / static_cast<double>(kReweightScale);
    const double w = start ? 1.0 : 1.0 / ((1.0 + t * t) * (1.0 + t * t));
    sums.a += w * l * l.transpose();
    sums.b += w * l * ranked.i.row(k).head<3>();
    sums.weights += w;
    sums.squares += w * r * r;
  }
  return sums;
}

struct PlainSearch {
  RankedSamples ranked;
  Eigen::Vector3d n = Eigen::Vector3d::Zero();
  double cost = std::numeric_limits<double>::infinity();  // logarithm of the product of (4)
};

PlainSearch SearchPlain(const PixelSystem& system, const Eigen::Vector3d& w) {
  PlainSearch search;
  search.ranked = Ranked(system, w);
  if (!search.ranked.order.empty()) {
    const PlainSums sums = SumsAt(system, search.ranked, search.n, /*start=*/true);
    search.n = sums.a.inverse() * (sums.b * w);
    search.cost =
        SearchPlainTriples(system, search.ranked, TripleSamplesOf(search.ranked), search.n);
  }
  return search;
}

}  // namespace

ConsensusAnswer PlainConsensus(const PixelSystem& system, double max_condition) {
  PlainSearch search = SearchPlain(system, LuminanceWeights());
  const Eigen::Vector3d chroma = ChromaOf(system);
  if (chroma != LuminanceWeights()) {
    PlainSearch other = SearchPlain(system, chroma);
    const auto in_band = [](const PlainSearch& of) { return of.ranked.end - of.ranked.begin; };
    if (in_band(other) >= in_band(search) &&
        other.cost < search.cost + std::log(static_cast<double>(kChromaAdvantage))) {
      search = std::move(other);
    }
  }
  const RankedSamples& ranked = search.ranked;
  if (ranked.order.empty()) {
    return {};
  }
  Eigen::Vector3d n = search.n;
  PlainSums sums;
  ConsensusAnswer answer;
  Eigen::Matrix3d n_rgb;
  for (int step = 0; step < kReweightings; ++step) {  // (5)
    sums = SumsAt(system, ranked, n, /*start=*/false);
    n_rgb = sums.a.inverse() * sums.b;
    n = n_rgb * ranked.w;
  }
  sums = SumsAt(system, ranked, n, /*start=*/false);
  if (!n.allFinite() || !(ConditionOfGram(sums.a) <= max_condition)) {
    return {};
  }
  const double spread = sums.squares / std::max(1.0, sums.weights - 3.0);
  const NormalVariances variances = VariancesOf(sums.a.inverse(), n);
  answer.uncertainty_deg = SpreadOf(variances.angular, spread) * kDegPerRad;
  answer.albedo_uncertainty = SpreadOf(variances.albedo, spread);
  for (const Eigen::Index k : ranked.order) {
    const double r = ranked.i(k, 3) - system.L().row(k).dot(n);
    answer.agreeing += std::abs(r) <= static_cast<double>(kAgreeing) ? 1 : 0;
  }
  answer.n = ranked.median * n;
  answer.albedo = ranked.median * n_rgb.colwise().norm().transpose().array();
  answer.residual = ranked.median * std::sqrt(sums.squares / sums.weights);
  return answer;
}

}  // namespace sateen
