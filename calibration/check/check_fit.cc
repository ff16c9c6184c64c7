#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include "calibration/check/check_system.h"
#include "calibration/check/check_unknowns.h"

namespace sateen {

namespace {

constexpr int kFitSteps = 5;         // of Gauss and Newton at most
constexpr double kSmallGain = 0.05;  // of chi2, below which no further step is made

// Where each free unknown stands in the system of all.
struct UnknownPlaces {
  std::vector<std::array<int, kCameraAt>> light;  // -1: not free
  std::array<int, 4> camera = {-1, -1, -1, -1};
  std::vector<std::array<int, 6>> sheet;
  int count = 0;

  UnknownPlaces(const ChangeMask& mask, const std::vector<bool>& used, size_t sheets) {
    light.resize(used.size());
    for (size_t k = 0; k < used.size(); ++k) {
      for (int i = 0; i < kCameraAt; ++i) {
        const bool is_free =
            used[k] && (i < kMovedAt || (i < kTurnedAt ? mask.moved[k] : mask.turned[k]));
        light[k][static_cast<size_t>(i)] = is_free ? count++ : -1;
      }
    }
    for (int& place : camera) {
      place = mask.camera ? count++ : -1;
    }
    sheet.resize(sheets);
    for (std::array<int, 6>& places : sheet) {
      for (int& place : places) {
        place = mask.sheets ? count++ : -1;
      }
    }
  }
  [[nodiscard]] int Of(size_t in_sheet, size_t in_light, int local) const {
    const auto i = static_cast<size_t>(local);
    if (local < kCameraAt) {
      return light[in_light][i];
    }
    return local < kSheetAt ? camera[i - kCameraAt] : sheet[in_sheet][i - kSheetAt];
  }
};

template <int Size>
Eigen::Matrix<double, Size, Size> CovarianceBlock(const Eigen::MatrixXd& covariance, int place) {
  return place < 0 ? Eigen::Matrix<double, Size, Size>::Zero().eval()
                   : covariance.block<Size, Size>(place, place).eval();
}

}  // namespace

int ChangeMask::Parameters(size_t sheet_count) const {
  return static_cast<int>(3 * std::ranges::count(moved, true) +
                          2 * std::ranges::count(turned, true)) +
         (camera ? 4 : 0) + (sheets ? 6 * static_cast<int>(sheet_count) : 0);
}

ChangeFit CheckSystem::Fit(const ChangeMask& mask, const RigChange& start) const {
  const UnknownPlaces places(mask, used_, sheets_.size());
  std::vector<Wanted> wanted;
  for (size_t k = 0; k < used_.size(); ++k) {
    wanted.push_back(WantedOf(k, mask.moved[k], mask.turned[k], mask.camera, mask.sheets));
  }
  ChangeFit fit{.change = start};
  Eigen::MatrixXd covariance;
  for (int step = 0;; ++step) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(places.count, places.count);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(places.count);
    std::vector<double*> unknowns(static_cast<size_t>(places.count), nullptr);
    std::vector<double> priors(unknowns.size(), 1.0);
    fit.chi2 = 0.0;
    const std::vector<std::vector<Normal>> normals = Normals(fit.change, wanted);
    for (size_t k = 0; k < normals.size(); ++k) {
      for (size_t s = 0; s < normals[k].size(); ++s) {
        const Normal& normal = normals[k][s];
        fit.chi2 += normal.chi2;
        for (int i = 0; i < kLocal; ++i) {
          const int row = places.Of(s, k, i);
          if (row < 0) {
            continue;
          }
          unknowns[static_cast<size_t>(row)] = &UnknownAt(fit.change, s, k, i);
          priors[static_cast<size_t>(row)] = PriorOfUnknown(i);
          gradient[row] += normal.gradient[i];
          for (int j = 0; j < kLocal; ++j) {
            const int column = places.Of(s, k, j);
            if (column >= 0) {
              matrix(row, column) += normal.matrix(i, j);
            }
          }
        }
      }
    }
    for (size_t i = 0; i < unknowns.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const double precision = 1.0 / (priors[i] * priors[i]);
      const double value = unknowns[i] == nullptr ? 0.0 : *unknowns[i];
      matrix(at, at) += precision;
      gradient[at] -= precision * value;
      fit.chi2 += precision * value * value;
    }
    const Eigen::LDLT<Eigen::MatrixXd> factors(matrix);
    const Eigen::VectorXd by = factors.solve(gradient);
    if (step == kFitSteps || gradient.dot(by) < kSmallGain) {
      covariance = factors.solve(Eigen::MatrixXd::Identity(places.count, places.count));
      break;
    }
    for (size_t i = 0; i < unknowns.size(); ++i) {
      if (unknowns[i] != nullptr) {
        *unknowns[i] += by[static_cast<Eigen::Index>(i)];
      }
    }
  }
  for (const std::array<int, kCameraAt>& place : places.light) {
    fit.flux.push_back(CovarianceBlock<3>(covariance, place[kFluxAt]));
    fit.moved_mm2.push_back(CovarianceBlock<3>(covariance, place[kMovedAt]));
    fit.turned_rad2.push_back(CovarianceBlock<2>(covariance, place[kTurnedAt]));
  }
  fit.camera = CovarianceBlock<4>(covariance, places.camera[0]);
  return fit;
}

std::vector<ChangeGain> CheckSystem::Gains(const ChangeFit& fit) const {
  std::vector<ChangeGain> gains(used_.size());
  std::vector<Wanted> wanted;
  for (size_t k = 0; k < used_.size(); ++k) {
    wanted.push_back(WantedOf(k, true, true, false, false));
  }
  const std::vector<std::vector<Normal>> normals = Normals(fit.change, wanted);
  for (size_t k = 0; k < normals.size(); ++k) {
    Normal sum;
    for (const Normal& normal : normals[k]) {
      sum += normal;
    }
    if (normals[k].empty()) {
      continue;
    }
    const Eigen::Matrix3d flux = (sum.matrix.block<3, 3>(kFluxAt, kFluxAt)).inverse();
    // What is left for unknowns [at, at + size) once the flux has followed.
    const auto gain = [&](auto at, auto size, ChangeGain* into) {
      constexpr int kSize = decltype(size)::value;
      const Eigen::Matrix<double, 3, kSize> with_flux =
          sum.matrix.block<3, kSize>(kFluxAt, decltype(at)::value);
      Eigen::Matrix<double, kSize, kSize> left =
          sum.matrix.block<kSize, kSize>(decltype(at)::value, decltype(at)::value) -
          with_flux.transpose() * flux * with_flux;
      const double prior = PriorOfUnknown(decltype(at)::value);
      left.diagonal().array() += 1.0 / (prior * prior);
      const Eigen::Matrix<double, kSize, 1> gradient =
          sum.gradient.segment<kSize>(decltype(at)::value) -
          with_flux.transpose() * flux * sum.gradient.head<3>();
      const Eigen::Matrix<double, kSize, kSize> covariance = left.inverse();
      const Eigen::Matrix<double, kSize, 1> by = covariance * gradient;
      if constexpr (kSize == 3) {
        into->moved_mm = by;
        into->moved_mm2 = covariance;
      }
      return gradient.dot(by);
    };
    gains[k].moved =
        gain(std::integral_constant<int, kMovedAt>(), std::integral_constant<int, 3>(), &gains[k]);
    gains[k].turned =
        gain(std::integral_constant<int, kTurnedAt>(), std::integral_constant<int, 2>(), &gains[k]);
  }
  return gains;
}

}  // namespace sateen
