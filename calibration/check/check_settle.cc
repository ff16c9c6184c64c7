#include "calibration/check/check_settle.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "calibration/check/check_unknowns.h"
#include "calibration/fit/robust_spread.h"
#include "core/gauss_newton.h"
#include "core/parallel.h"

namespace sateen {
namespace {

constexpr int kSettleSteps = 8;
constexpr double kSettleLossScale = 2.0;  // times the residuals' spread
constexpr double kSettleOutlierScale = 4.0;
constexpr int kSquareBlocks = 6;  // along a side, over which residuals may be correlated

// Residuals of one light on all sheets.
struct SettleResiduals {
  std::vector<std::vector<double>> off;  // [sheet][3 per sample]
  double spread = 1.0;

  SettleResiduals(const CheckModel& model, size_t light, const RigChange& change) {
    std::vector<double> all;
    for (size_t s = 0; s < model.Sheets().size(); ++s) {
      off.push_back(model.Residuals(s, light, change));
      all.insert(all.end(), off[s].begin(), off[s].end());
    }
    spread = all.empty() ? 1.0 : SpreadOf(all);
  }

  [[nodiscard]] size_t SampleCount(size_t sheet) const { return off[sheet].size() / 3; }

  // Returns the largest of a sample's three residuals, in units of the spread.
  [[nodiscard]] double Worst(size_t sheet, size_t j) const {
    const double* r = &off[sheet][3 * j];
    return std::max({std::abs(r[0]), std::abs(r[1]), std::abs(r[2])}) / spread;
  }

  // Returns a weight for each sample: of its worst residual, in units of the spread.
  template <typename WeightOf>
  [[nodiscard]] SheetWeights Weights(const WeightOf& weight_of) const {
    SheetWeights weights(off.size());
    for (size_t s = 0; s < off.size(); ++s) {
      for (size_t j = 0; j < SampleCount(s); ++j) {
        weights[s].push_back(weight_of(Worst(s, j)));
      }
    }
    return weights;
  }
};

// Returns the normal equations of one light's own unknowns with Cauchy's weights.
NormalEquations<kOfLight> SettleEquations(const CheckModel& model, size_t light,
                                          const RigChange& change) {
  const SettleResiduals residuals(model, light, change);
  const double variance = residuals.spread * residuals.spread;
  const SheetWeights weights = residuals.Weights([&](double worst) {
    const double scaled = worst / kSettleLossScale;
    return 1.0 / (variance * (1.0 + scaled * scaled));
  });
  LocalEquations all;
  const WantedUnknowns wanted = model.WantedOf(light, true, true, false, false);
  for (size_t s = 0; s < weights.size(); ++s) {
    model.AddReadings(s, light, change, weights[s], wanted, all);
  }
  AddPriorsOf(light, change, all);
  NormalEquations<kOfLight> own;
  own.information = all.information.topLeftCorner<kOfLight, kOfLight>();
  own.gradient = all.gradient.head<kOfLight>();
  own.cost = all.cost;
  return own;
}

// Returns V_6 / V_1 of (1), at least 1, from the green residuals.
double CorrelationOf(const CheckModel& model, size_t light, const SettleResiduals& residuals) {
  double single = 0.0;
  double squares = 0.0;
  double single_count = 0.0;
  double square_count = 0.0;
  for (size_t s = 0; s < residuals.off.size(); ++s) {
    const SheetReadings& sheet = model.Sheets()[s];
    const std::vector<double>& off = residuals.off[s];
    if (off.empty()) {
      continue;
    }
    const double limit = kSettleOutlierScale * SpreadOf(off);
    std::map<int, std::pair<double, double>> sums;  // of each square: sum and count
    for (size_t j = 0; j < residuals.SampleCount(s); ++j) {
      const double green = off[3 * j + 1];
      if (std::abs(green) > limit) {
        continue;
      }
      const int block = sheet.blocks[light][j];
      const int column = block % sheet.columns / kSquareBlocks;
      const int row = block / sheet.columns / kSquareBlocks;
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

}  // namespace

SettledLight SettleLight(const CheckModel& model, size_t light) {
  // The weights follow the residuals, so that the cost of one step is not that of the next.
  const RigChange change =
      MinimizeSquares<kOfLight>(
          model.Unchanged(), [&](const RigChange& at) { return SettleEquations(model, light, at); },
          [&](RigChange at, const Unknowns<kOfLight>& step) {
            for (int i = 0; i < kOfLight; ++i) {
              UnknownAt(at, 0, light, i) += step[i];
            }
            return at;
          },
          {.rule = StepRule::kFull, .max_iterations = kSettleSteps, .min_relative_fall = 0.0})
          .state;
  const SettleResiduals residuals(model, light, change);
  const double variance =
      residuals.spread * residuals.spread * CorrelationOf(model, light, residuals);
  return {.change = change.lights[light], .weights = residuals.Weights([&](double worst) {
            return worst <= kSettleOutlierScale ? 1.0 / variance : 0.0;
          })};
}

SampleWeights SettledWeights(const CheckModel& model, const std::vector<bool>& used,
                             const Task& task) {
  SampleWeights weights(used.size());
  (void)ParallelFor(static_cast<int>(used.size()), 1, Task{.threads = task.threads},
                    [&](int begin, int end) {
                      for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
                        if (used[k]) {
                          weights[k] = SettleLight(model, k).weights;
                        }
                      }
                    });
  return weights;
}

}  // namespace sateen
