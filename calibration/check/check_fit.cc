#include "calibration/check/check_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <limits>

#include "calibration/check/check_unknowns.h"
#include "core/gauss_newton.h"
#include "core/linear_algebra.h"
#include "core/parallel.h"

namespace sateen {
namespace {

constexpr int kFitSteps = 5;
constexpr double kSmallGain = 0.05;  // fall of chi2 below which no further step is made

using LocalSystems = std::vector<std::vector<LocalEquations>>;  // [light][sheet]

bool TakesPart(const SampleWeights& weights, size_t light) { return !weights[light].empty(); }

LocalSystems SystemsOf(const CheckModel& model, const SampleWeights& weights,
                       const RigChange& change, const std::vector<WantedUnknowns>& wanted,
                       const Task& task) {
  LocalSystems systems(weights.size());
  (void)ParallelFor(
      static_cast<int>(weights.size()), 1, Task{.threads = task.threads}, [&](int begin, int end) {
        for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
          for (size_t s = 0; s < weights[k].size(); ++s) {
            model.AddReadings(s, k, change, weights[k][s], wanted[k], systems[k].emplace_back());
          }
        }
      });
  return systems;
}

// Places of the free unknowns in the system of all; -1: not free.
class UnknownPlaces {
 public:
  UnknownPlaces(const ChangeMask& mask, const SampleWeights& weights, size_t sheets)
      : light_(weights.size()), sheet_(sheets) {
    for (size_t k = 0; k < light_.size(); ++k) {
      for (int i = 0; i < kOfLight; ++i) {
        const bool is_free = TakesPart(weights, k) &&
                             (i < kMovedAt || (i < kTurnedAt ? mask.moved[k] : mask.turned[k]));
        light_[k][static_cast<size_t>(i)] = is_free ? count_++ : -1;
      }
    }
    for (int& place : camera_) {
      place = mask.camera ? count_++ : -1;
    }
    for (std::array<int, kLocal - kSheetAt>& places : sheet_) {
      for (int& place : places) {
        place = mask.sheets ? count_++ : -1;
      }
    }
  }

  [[nodiscard]] int Count() const { return count_; }

  [[nodiscard]] int Of(size_t sheet, size_t light, int local) const {
    const auto i = static_cast<size_t>(local);
    if (local < kCameraAt) {
      return light_[light][i];
    }
    return local < kSheetAt ? camera_[i - kCameraAt] : sheet_[sheet][i - kSheetAt];
  }

  // Calls `visit` with sheet, light and local number of each free unknown, in the order of places.
  template <typename Visit>
  void ForEach(const Visit& visit) const {
    for (size_t k = 0; k < light_.size(); ++k) {
      VisitRange(0, k, 0, kOfLight, visit);
    }
    VisitRange(0, 0, kCameraAt, kSheetAt, visit);
    for (size_t s = 0; s < sheet_.size(); ++s) {
      VisitRange(s, 0, kSheetAt, kLocal, visit);
    }
  }

 private:
  template <typename Visit>
  void VisitRange(size_t sheet, size_t light, int from, int to, const Visit& visit) const {
    for (int local = from; local < to; ++local) {
      if (const int place = Of(sheet, light, local); place >= 0) {
        visit(place, sheet, light, local);
      }
    }
  }

  std::vector<std::array<int, kOfLight>> light_;
  std::array<int, kSheetAt - kCameraAt> camera_ = {};
  std::vector<std::array<int, kLocal - kSheetAt>> sheet_;
  int count_ = 0;
};

// Returns the normal equations of (1).
NormalEquations<Eigen::Dynamic> EquationsOf(const UnknownPlaces& places,
                                            const LocalSystems& systems, const RigChange& change) {
  NormalEquations<Eigen::Dynamic> all(places.Count());
  for (size_t k = 0; k < systems.size(); ++k) {
    for (size_t s = 0; s < systems[k].size(); ++s) {
      const LocalEquations& local = systems[k][s];
      all.cost += local.cost;
      for (int i = 0; i < kLocal; ++i) {
        const int row = places.Of(s, k, i);
        if (row < 0) {
          continue;
        }
        all.gradient[row] += local.gradient[i];
        for (int j = 0; j < kLocal; ++j) {
          if (const int column = places.Of(s, k, j); column >= 0) {
            all.information(row, column) += local.information(i, j);
          }
        }
      }
    }
  }
  Eigen::VectorXd from_mean(places.Count());
  Eigen::MatrixXd precision = Eigen::MatrixXd::Zero(places.Count(), places.Count());
  places.ForEach([&](int place, size_t s, size_t k, int local) {
    from_mean[place] = UnknownAt(change, s, k, local);
    precision(place, place) = 1.0 / (PriorSdOf(local) * PriorSdOf(local));
  });
  all.AddPrior(from_mean, precision);
  return all;
}

// Returns the covariance of `Size` unknowns from a place on; zero where they are not free.
template <int Size>
Eigen::Matrix<double, Size, Size> CovarianceBlock(const Eigen::MatrixXd& covariance, int place) {
  return place < 0 ? Eigen::Matrix<double, Size, Size>::Zero().eval()
                   : covariance.block<Size, Size>(place, place).eval();
}

// Step of some unknowns of one light, its flux following.
template <int Size>
struct FollowedStep {
  Eigen::Matrix<double, Size, Size> covariance;
  double gain = 0.0;  // fall of chi2
};

// Eliminates the flux from the unknowns [At, At + Size).
template <int At, int Size>
FollowedStep<Size> StepWithFlux(const LocalEquations& light) {
  const Eigen::Matrix3d flux = light.information.block<3, 3>(kFluxAt, kFluxAt).inverse();
  const Eigen::Matrix<double, 3, Size> with_flux = light.information.block<3, Size>(kFluxAt, At);
  const Eigen::Matrix<double, Size, Size> left =
      light.information.block<Size, Size>(At, At) - with_flux.transpose() * flux * with_flux;
  const Eigen::Matrix<double, Size, 1> gradient =
      light.gradient.segment<Size>(At) - with_flux.transpose() * flux * light.gradient.head<3>();
  const Eigen::Matrix<double, Size, Size> covariance = left.inverse();
  return {covariance, gradient.dot(covariance * gradient)};
}

}  // namespace

ChangeFit FitChange(const CheckModel& model, const SampleWeights& weights, const ChangeMask& mask,
                    const RigChange& start, const Task& task) {
  const UnknownPlaces places(mask, weights, model.Sheets().size());
  std::vector<WantedUnknowns> wanted;
  for (size_t k = 0; k < weights.size(); ++k) {
    wanted.push_back(model.WantedOf(k, mask.moved[k], mask.turned[k], mask.camera, mask.sheets));
  }
  const auto descent = MinimizeSquares<Eigen::Dynamic>(
      start,
      [&](const RigChange& at) {
        return EquationsOf(places, SystemsOf(model, weights, at, wanted, task), at);
      },
      [&](RigChange at, const Eigen::VectorXd& step) {
        places.ForEach([&](int place, size_t s, size_t k, int local) {
          UnknownAt(at, s, k, local) += step[place];
        });
        return at;
      },
      {.rule = StepRule::kFull,
       .max_iterations = kFitSteps,
       .min_relative_fall = 0.0,
       .min_gain = kSmallGain});
  ChangeFit fit{.change = descent.state, .chi2 = descent.equations.cost};
  if (descent.end == GaussNewtonEnd::kNotFinite) {
    fit.chi2 = std::numeric_limits<double>::infinity();
  }
  const Eigen::MatrixXd covariance = InverseOfSymmetric(descent.equations.information);
  for (size_t k = 0; k < weights.size(); ++k) {
    fit.flux.push_back(CovarianceBlock<3>(covariance, places.Of(0, k, kFluxAt)));
    fit.moved_mm2.push_back(CovarianceBlock<3>(covariance, places.Of(0, k, kMovedAt)));
    fit.turned_rad2.push_back(CovarianceBlock<2>(covariance, places.Of(0, k, kTurnedAt)));
  }
  fit.camera = CovarianceBlock<4>(covariance, places.Of(0, 0, kCameraAt));
  return fit;
}

std::vector<ChangeGain> GainsOf(const CheckModel& model, const SampleWeights& weights,
                                const ChangeFit& fit, const Task& task) {
  std::vector<ChangeGain> gains(weights.size());
  std::vector<WantedUnknowns> wanted;
  for (size_t k = 0; k < weights.size(); ++k) {
    wanted.push_back(model.WantedOf(k, true, true, false, false));
  }
  const LocalSystems systems = SystemsOf(model, weights, fit.change, wanted, task);
  for (size_t k = 0; k < systems.size(); ++k) {
    if (!TakesPart(weights, k)) {
      continue;
    }
    LocalEquations sum;
    for (const LocalEquations& one : systems[k]) {
      sum.information += one.information;
      sum.gradient += one.gradient;
      sum.cost += one.cost;
    }
    AddPriorsOf(k, fit.change, sum);
    const FollowedStep<3> moved = StepWithFlux<kMovedAt, 3>(sum);
    const FollowedStep<2> turned = StepWithFlux<kTurnedAt, 2>(sum);
    gains[k] = {moved.gain, turned.gain, moved.covariance};
  }
  return gains;
}

}  // namespace sateen
