#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "calibration/check/check_system.h"
#include "calibration/check/check_unknowns.h"
#include "calibration/fit/robust_spread.h"

namespace sateen {

namespace {

constexpr int kSettleSteps = 8;           // of a robust fit
constexpr double kSettleLossScale = 2.0;  // of the residuals' spread
constexpr double kSettleOutlierScale = 4.0;
constexpr int kTogether = 6;  // blocks along a square over which residuals may hang together

}  // namespace

// A robust fit of the light alone, whatever it needs; then the noise, from what that leaves.
void CheckSystem::Settle(size_t light) {
  RigChange change = Unchanged();
  Weights& weights = weights_[light];
  weights.resize(sheets_.size());
  double spread = 1.0;
  std::vector<std::vector<double>> off(sheets_.size());
  const auto look = [&] {
    std::vector<double> all;
    for (size_t s = 0; s < sheets_.size(); ++s) {
      off[s] = Residuals(s, light, change);
      all.insert(all.end(), off[s].begin(), off[s].end());
    }
    spread = SpreadOf(all);
  };
  // Of the worst of a sample's three residuals, in units of the spread.
  const auto worst = [&](size_t s, size_t j) {
    return std::max({std::abs(off[s][3 * j]), std::abs(off[s][3 * j + 1]),
                     std::abs(off[s][3 * j + 2])}) /
           spread;
  };
  look();
  for (int step = 0; step < kSettleSteps; ++step) {
    Normal sum;
    for (size_t s = 0; s < sheets_.size(); ++s) {
      weights[s].resize(off[s].size() / 3);
      for (size_t j = 0; j < weights[s].size(); ++j) {
        const double scaled = worst(s, j) / kSettleLossScale;
        weights[s][j] = 1.0 / (spread * spread * (1.0 + scaled * scaled));
      }
      sum += NormalOf(s, light, change, weights[s], WantedOf(light, true, true, false, false));
    }
    Eigen::Matrix<double, kOfLight, kOfLight> matrix =
        sum.matrix.topLeftCorner<kOfLight, kOfLight>();
    Eigen::Matrix<double, kOfLight, 1> gradient = sum.gradient.head<kOfLight>();
    for (int i = 0; i < kOfLight; ++i) {
      matrix(i, i) += 1.0 / (PriorOfUnknown(i) * PriorOfUnknown(i));
      gradient[i] -= UnknownAt(change, 0, light, i) / (PriorOfUnknown(i) * PriorOfUnknown(i));
    }
    const Eigen::Matrix<double, kOfLight, 1> by = matrix.ldlt().solve(gradient);
    for (int i = 0; i < kOfLight; ++i) {
      UnknownAt(change, 0, light, i) += by[i];
    }
    look();
  }
  const double together = SpreadTogether(light, change);
  for (size_t s = 0; s < sheets_.size(); ++s) {
    for (size_t j = 0; j < weights[s].size(); ++j) {
      weights[s][j] = worst(s, j) <= kSettleOutlierScale ? 1.0 / (spread * spread * together) : 0.0;
    }
  }
}

// By how much the means of squares of blocks vary more than they would if blocks did not hang
// together; at least 1.
double CheckSystem::SpreadTogether(size_t light, const RigChange& change) const {
  double single = 0.0;
  double squares = 0.0;
  double single_count = 0.0;
  double square_count = 0.0;
  for (size_t s = 0; s < sheets_.size(); ++s) {
    const CheckedSheet& sheet = sheets_[s];
    const std::vector<double> off = Residuals(s, light, change);
    const double limit = kSettleOutlierScale * SpreadOf(off);
    std::map<int, std::pair<double, double>> sums;  // of a square: sum, count
    for (size_t j = 0; j < off.size() / 3; ++j) {
      const double green = off[3 * j + 1];
      if (std::abs(green) > limit) {
        continue;
      }
      const int block = sheet.blocks[light][j];
      const int column = block % sheet.columns / kTogether;
      const int row = block / sheet.columns / kTogether;
      auto& [sum, count] = sums[row * sheet.columns + column];
      sum += green;
      count += 1.0;
      single += green * green;
      single_count += 1.0;
    }
    for (const auto& [place, square] : sums) {
      squares += square.first * square.first / square.second;
      square_count += 1.0;
    }
  }
  return single > 0.0 ? std::max(1.0, squares / square_count / (single / single_count)) : 1.0;
}

}  // namespace sateen
