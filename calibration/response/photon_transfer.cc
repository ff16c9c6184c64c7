#include "calibration/response/photon_transfer.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace sateen {
namespace {

constexpr double kRounding = 1.0 / 12.0;  // variance of rounding to whole readings
constexpr double kSmallestVariance = 1e-9;
constexpr int kFitRounds = 20;

struct Line {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();  // sigma^2, g
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

// Fits (1) by least squares, weighted anew from the line in each round.
Line FitLine(const std::vector<const TransferPoint*>& points) {
  Line line;
  std::vector<double> expected;
  expected.reserve(points.size());
  for (const TransferPoint* point : points) {
    expected.push_back(std::max(point->variance_dn2, kRounding));
  }
  for (int round = 0; round < kFitRounds; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d row(1.0, points[i]->mean_dn);
      const double weight = (points[i]->count - 1.0) / (2.0 * expected[i] * expected[i]);
      normal += weight * row * row.transpose();
      right += weight * row * (points[i]->variance_dn2 - kRounding);
    }
    line.covariance = normal.inverse();
    line.value = line.covariance * right;
    for (size_t i = 0; i < points.size(); ++i) {
      expected[i] = std::max(line.value[0] + line.value[1] * points[i]->mean_dn + kRounding,
                             kSmallestVariance);
    }
  }
  return line;
}

double MisfitOf(const std::vector<const TransferPoint*>& points, const Line& line) {
  double sum = 0.0;
  for (const TransferPoint* point : points) {
    const double expected =
        std::max(line.value[0] + line.value[1] * point->mean_dn + kRounding, kSmallestVariance);
    const double off = (point->variance_dn2 - expected) / expected;
    sum += 0.5 * off * off * (point->count - 1.0);
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

// Adds the points of one patch in a pair of frames, one per colour that is usable.
void AddPair(const PatchSites& sites, const std::vector<uint16_t>& a,
             const std::vector<uint16_t>& b, const std::array<double, 3>& mean_dn,
             const std::array<bool, 3>& is_usable, bool is_dark,
             std::vector<TransferPoint>& points) {
  std::array<double, 3> sum = {};
  std::array<double, 3> squares = {};
  std::array<double, 3> count = {};
  for (size_t i = 0; i < a.size(); ++i) {
    const size_t c = sites.colour[i];
    const double difference = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum[c] += difference;
    squares[c] += difference * difference;
    count[c] += 1.0;
  }
  for (size_t c = 0; c < 3; ++c) {
    if (is_usable[c]) {
      const double variance = (squares[c] - sum[c] * sum[c] / count[c]) / (count[c] - 1.0);
      points.push_back({.mean_dn = mean_dn[c],
                        .variance_dn2 = 0.5 * variance,
                        .count = count[c],
                        .colour = c,
                        .is_dark = is_dark});
    }
  }
}

// Pairs frames of one light and exposure, or dark frames of one exposure, in their order.
std::vector<std::pair<size_t, size_t>> PairsOf(const std::vector<ChartFrame>& frames) {
  std::map<std::pair<std::optional<size_t>, double>, std::optional<size_t>> waiting;
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t f = 0; f < frames.size(); ++f) {
    std::optional<size_t>& first = waiting[{frames[f].light, frames[f].exposure_s}];
    if (first) {
      pairs.emplace_back(*first, f);
      first.reset();
    } else {
      first = f;
    }
  }
  return pairs;
}

}  // namespace

std::vector<TransferPoint> TransferPoints(const ChartReadings& readings,
                                          const std::vector<PatchSample>& samples,
                                          double highest_dn) {
  std::map<std::pair<size_t, size_t>, std::array<const PatchSample*, 3>> sample_of;
  for (const PatchSample& sample : samples) {
    sample_of[{sample.frame, sample.patch}][sample.colour] = &sample;
  }
  std::vector<TransferPoint> points;
  for (const auto& [a, b] : PairsOf(readings.frames)) {
    const bool is_dark = !readings.frames[a].light;
    for (size_t patch = 0; patch < readings.patches.size(); ++patch) {
      std::array<double, 3> mean_dn = {};
      std::array<bool, 3> is_usable = {is_dark, is_dark, is_dark};
      const auto of_a = sample_of.find({a, patch});
      const auto of_b = sample_of.find({b, patch});
      for (size_t c = 0; c < 3 && of_a != sample_of.end() && of_b != sample_of.end(); ++c) {
        mean_dn[c] = 0.5 * (of_a->second[c]->signal_dn + of_b->second[c]->signal_dn);
        is_usable[c] = std::max(of_a->second[c]->top_dn, of_b->second[c]->top_dn) < highest_dn;
      }
      AddPair(readings.patches[patch], readings.frames[a].dn[patch], readings.frames[b].dn[patch],
              mean_dn, is_usable, is_dark, points);
    }
  }
  return points;
}

Result<PhotonTransfer> FitPhotonTransfer(std::vector<TransferPoint> points, bool use_dark) {
  std::vector<const TransferPoint*> used;
  std::array<std::vector<const TransferPoint*>, 3> used_rgb;
  size_t lit = 0;
  double largest = 0.0;
  for (const TransferPoint& point : points) {
    if (point.is_dark && !use_dark) {
      continue;
    }
    used.push_back(&point);
    used_rgb[point.colour].push_back(&point);
    lit += point.is_dark ? 0 : 1;
    largest = std::max(largest, point.variance_dn2);
  }
  if (lit < 3 || std::ranges::any_of(used_rgb, [](const auto& own) { return own.size() < 2; })) {
    return Fail(ErrorCode::kDegenerate,
                "pairs of equal frames show {} patches that can be used; need at least three, of "
                "every colour",
                lit);
  }
  const Line line = FitLine(used);
  if (!(line.value[1] > 0.0) || largest < 2.0 * kRounding) {
    return Fail(ErrorCode::kDegenerate,
                "the noise of the pairs does not grow with their brightness; need pairs as the "
                "sensor reads them, each frame its own exposure");
  }
  PhotonTransfer transfer;
  transfer.gain_dn_per_electron = line.value[1];
  transfer.gain_sd = std::sqrt(line.covariance(1, 1));
  transfer.read_noise_dn = std::sqrt(std::max(line.value[0], 0.0));
  transfer.read_noise_sd =
      std::sqrt(line.covariance(0, 0)) / (2.0 * std::max(transfer.read_noise_dn, 1e-3));
  transfer.misfit = MisfitOf(used, line);
  for (size_t c = 0; c < 3; ++c) {
    const Line own = FitLine(used_rgb[c]);
    transfer.gain_rgb[c] = own.value[1];
    transfer.gain_rgb_sd[c] = std::sqrt(own.covariance(1, 1));
  }
  transfer.points = std::move(points);
  return transfer;
}

}  // namespace sateen
