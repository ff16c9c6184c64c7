#include "solver/robust/plain_ladder.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "imaging/color.h"
#include "solver/kernels/consensus.h"

namespace sateen {
namespace {

constexpr float kMarked = -1.0F;
constexpr double kLeastVarianceShare = 1e-6;  // for channels without noise

Eigen::Vector3d LuminanceWeights() {
  return {static_cast<double>(kLuminance[0]), static_cast<double>(kLuminance[1]),
          static_cast<double>(kLuminance[2])};
}

// Variances of the angle, (tr C - n C n) / |N|^2, and of the albedo over its square, n C n / |N|^2.
struct PlainVariances {
  double angular;
  double albedo;
};

PlainVariances VariancesOf(const Eigen::Matrix3d& c, const Eigen::Vector3d& n) {
  const double squared = n.squaredNorm();
  const double along = n.dot(c * n) / squared;
  return {std::max(0.0, c.trace() - along) / squared, std::max(0.0, along) / squared};
}

// (11), of a variance of VariancesOf().
double SpreadOf(double variance, double mean_square) {
  return std::hypot(static_cast<double>(kUncertaintyFactor) * std::sqrt(variance * mean_square),
                    static_cast<double>(kLeastModelUncertainty));
}

// A pixel's samples in order of brightness, in medians.
struct RankedSamples {
  std::vector<Eigen::Index> order;  // all usable ones
  size_t begin = 0;                 // of the band
  size_t end = 0;
  double median = 0.0;
  Eigen::MatrixX4d i;  // the last column is j
  Eigen::Vector3d w;   // of (6)
};

// (6); luminance where the pixel is grey.
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
  return ranked;  // (7)
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

// (8), (9); `n` stays where no triple is well conditioned.
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

// (10) and the sums of (11).
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
  double cost = std::numeric_limits<double>::infinity();  // logarithm of the product of (9)
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

PlainAnswer PlainWeighted(const PixelSystem& system, const StackNoise& noise) {
  const auto l = system.L();
  const Eigen::Vector3d n = SolveNormalEquations(l, Eigen::VectorXd(system.Rhs().col(3)));
  PlainAnswer answer;
  answer.residual = (system.Rhs().col(3) - l * n).norm() / std::sqrt(system.Count());
  const Eigen::Vector4d sum = system.Rhs().colwise().sum().transpose();
  const Eigen::Array3d b = sum.head<3>().array().max(0.0) / sum[3];              // (2)
  const auto variances = [&](Eigen::Index k, double bright) -> Eigen::Array3d {  // (1)
    const SampleNoise& of_frame = noise[static_cast<size_t>(system.FrameOf(k))];
    const Eigen::Array3d f = 1.0 / system.E().row(k).transpose().array();
    return f * (Eigen::Map<const Eigen::Array3d>(of_frame.shot.data()) * b * bright +
                f * Eigen::Map<const Eigen::Array3d>(of_frame.read.data()).square());
  };
  Eigen::Array3d v = variances(0, n.norm());
  v = v.max(kLeastVarianceShare * v.sum());
  const Eigen::Array3d u = b / v / (b.square() / v).sum();  // (3)
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double chi_squared = 0.0;
  for (Eigen::Index k = 0; k < system.Count(); ++k) {
    const double predicted = l.row(k).dot(n);
    const double bright = std::max(predicted, static_cast<double>(kLeastCosine) * n.norm());
    const double weight = 1.0 / (u.square() * variances(k, bright)).sum();
    const double r = system.Rhs().row(k).head<3>().dot(u.matrix()) - predicted;
    a += weight * l.row(k).transpose() * l.row(k);
    gradient += weight * r * l.row(k).transpose();
    chi_squared += weight * r * r;
  }
  const Eigen::Matrix3d covariance = a.inverse();
  const Eigen::Vector3d step = covariance * gradient;
  if (!step.allFinite()) {
    return answer;
  }
  answer.n = n + step;  // (4)
  answer.albedo = b * answer.n.norm();
  const PlainVariances of_n = VariancesOf(covariance, answer.n);  // (4)
  answer.uncertainty_deg = std::sqrt(of_n.angular) * kDegPerRad;
  const double of_luminance =
      (LuminanceWeights().array().square() * v).sum() / (u.square() * v).sum();
  answer.albedo_uncertainty =
      std::sqrt(std::max(0.0, of_n.albedo + (of_luminance - 1.0) / answer.n.dot(a * answer.n)));
  if (system.Count() > 3) {
    answer.misfit = std::max(0.0, chi_squared - gradient.dot(step)) / (system.Count() - 3);  // (5)
  }
  return answer;
}

PlainAnswer PlainConsensus(const PixelSystem& system, double max_condition) {
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
  PlainAnswer answer;
  Eigen::Matrix3d n_rgb;
  for (int step = 0; step < kReweightings; ++step) {  // (10)
    sums = SumsAt(system, ranked, n, /*start=*/false);
    n_rgb = sums.a.inverse() * sums.b;
    n = n_rgb * ranked.w;
  }
  sums = SumsAt(system, ranked, n, /*start=*/false);
  if (!n.allFinite() || !(ConditionOfGram(sums.a) <= max_condition)) {
    return {};
  }
  const double spread = sums.squares / std::max(1.0, sums.weights - 3.0);
  const PlainVariances variances = VariancesOf(sums.a.inverse(), n);
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

void MarkPending(Reason which, int row_begin, int row_end, const NormalField& field,
                 std::span<float> misfits) {
  const size_t first = field.reason.Index(0, row_begin);
  for (size_t p = first; p < field.reason.Index(0, row_end); ++p) {
    if (field.reason.pixels[p] == static_cast<uint8_t>(which)) {
      misfits[p - first] = kMarked;
    }
  }
}

void WeighRowsInDouble(const LightStack& stack, const Rig& rig, const LambertianOptions& options,
                       const StackNoise& noise, double noise_scale, int row_begin, int row_end,
                       NormalField& field, std::span<float> misfits) {
  PixelSystem system(stack, rig, options);
  const size_t first = field.reason.Index(0, row_begin);
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t pixel = first; pixel < field.reason.Index(0, row_end); ++pixel) {
    float& misfit = misfits[pixel - first];
    if (misfit != kMarked) {
      continue;
    }
    misfit = 0.0F;
    field.uncertainty.pixels[pixel] = 0.0F;
    field.albedo_uncertainty.pixels[pixel] = 0.0F;
    field.model.pixels[pixel] = static_cast<uint8_t>(Rung::kNone);
    if (field.reason.pixels[pixel] != static_cast<uint8_t>(Reason::kSolved)) {
      continue;
    }
    system.Gather(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
    field.model.pixels[pixel] =
        static_cast<uint8_t>(system.Count() <= 3 ? Rung::kUnchecked : Rung::kLeastSquares);
    const PlainAnswer answer = PlainWeighted(system, noise);
    const Eigen::Vector3d n = answer.n.stableNormalized();
    if (!n.allFinite() || n.isZero()) {
      field.uncertainty.pixels[pixel] = 180.0F;
      field.albedo_uncertainty.pixels[pixel] = 1.0F;
      continue;
    }
    for (size_t c = 0; c < 3; ++c) {
      const auto column = static_cast<Eigen::Index>(c);
      field.normal[c].pixels[pixel] = static_cast<float>(n[column]);
      field.albedo[c].pixels[pixel] = static_cast<float>(answer.albedo[column]);
    }
    // In this order the minimum of a bound and not-a-number, of an infinite scale, is the bound.
    field.uncertainty.pixels[pixel] =
        static_cast<float>(std::min(180.0, answer.uncertainty_deg * noise_scale));
    field.albedo_uncertainty.pixels[pixel] =
        static_cast<float>(std::min(1.0, answer.albedo_uncertainty * noise_scale));
    misfit = static_cast<float>(answer.misfit);
  }
}

}  // namespace sateen
