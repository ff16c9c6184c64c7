#include "scanner/checks/registration_level.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/linear_algebra.h"
#include "core/statistics.h"
#include "scanner/checks/registration_images.h"

namespace sateen {
namespace {

constexpr int kMargin = 2;             // cells that a derivative takes to each side
constexpr int kTile = 8;               // cells along each side
constexpr double kLightError = 0.3;    // a of (1), relative to |l|
constexpr double kMostCells = 1.5;     // longest step: beyond, (1) is no longer linear
constexpr Eigen::Index kUnknowns = 5;  // unknowns per frame: dx, dy, and a

// Returns the slope of the parabola of fourth order: a difference of two neighbours would be a
// third too small for a texture of 4 cells, and the steps that much too large.
double Slope(float before2, float before, float after, float after2) {
  return (8.0 * static_cast<double>(after - before) - static_cast<double>(after2 - before2)) / 12.0;
}

}  // namespace

RegistrationLevel::RegistrationLevel(const std::vector<Image<float>>& frames,
                                     const FramesToRegister& input, double cells)
    : count_(static_cast<Eigen::Index>(frames.size())), bright_(frames[0].Size()) {
  for (const Image<float>& frame : frames) {
    high_.push_back(HighPassed(frame));
    for (size_t p = 0; p < bright_.pixels.size(); ++p) {
      bright_.pixels[p] += frame.pixels[p] / static_cast<float>(count_);
    }
  }
  const int width = bright_.width;
  const int height = bright_.height;
  for (int y = kMargin; y + kMargin < height; y += kTile) {
    for (int x = kMargin; x + kMargin < width; x += kTile) {
      Tile tile{.left = x,
                .top = y,
                .right = std::min(x + kTile, width - kMargin),
                .bottom = std::min(y + kTile, height - kMargin)};
      const Eigen::Vector2d middle(0.5 * (tile.left + tile.right - 1),
                                   0.5 * (tile.top + tile.bottom - 1));
      if (AddLights(input, (middle.array() + 0.5) * cells - 0.5, tile)) {
        tiles_.push_back(std::move(tile));
      }
    }
  }
}

double RegistrationLevel::Misfit(const std::vector<Eigen::Vector2d>& shifts) {
  Move(shifts);
  double sum = 0.0;
  double cells = 0.0;
  double all = 0.0;
  double left = 0.0;
  for (const Tile& tile : tiles_) {
    Gather(tile, /*with_gradients=*/false);
    sum += r_.sum();
    cells += static_cast<double>(r_.size());
    all += v_.squaredNorm();
    left += misfit2_.sum();
  }
  const auto frames = static_cast<double>(count_);
  explained_ = all > 0.0 ? 1.0 - left / (frames - 3.0) / (all / frames) : 0.0;
  return cells > 0.0 ? sum / cells : std::numeric_limits<double>::infinity();
}

double RegistrationLevel::Step(std::vector<Eigen::Vector2d>& shifts, std::vector<double>& sd) {
  Move(shifts);
  scale_ = MisfitScale();
  const Eigen::Index size = kUnknowns * count_;
  NormalEquations all{Matrix::Zero(size, size), Vector::Zero(size)};
  Matrix outer = Matrix::Zero(size, size);
  double sum_r2 = 0.0;
  double sum_w = 0.0;
  for (const Tile& tile : tiles_) {
    Gather(tile, /*with_gradients=*/true);
    if (r_.size() == 0) {
      continue;
    }
    const Vector b = Accumulate(tile, all);
    outer.selfadjointView<Eigen::Lower>().rankUpdate(b);
    sum_r2 += (w_.array() * misfit2_.array()).sum();
    sum_w += w_.sum();
  }
  if (sum_w <= 0.0) {
    return 0.0;
  }
  const double variance = sum_r2 / (sum_w * static_cast<double>(count_ - 3));
  AddRidge(variance, all.a);
  const Vector theta = SolveSymmetric(all.a, all.b);
  const Matrix half = SolveSymmetric(all.a, Matrix(outer.selfadjointView<Eigen::Lower>()));
  const Matrix covariance = SolveSymmetric(all.a, Matrix(half.transpose()));
  double longest = 0.0;
  for (Eigen::Index k = 1; k < count_; ++k) {
    Eigen::Vector2d step = theta.segment<2>(kUnknowns * k);
    step *= std::min(1.0, kMostCells / std::max(step.norm(), 1e-12));
    shifts[static_cast<size_t>(k)] += step;
    longest = std::max(longest, step.norm());
    sd[static_cast<size_t>(k)] = std::sqrt(covariance.diagonal().segment<2>(kUnknowns * k).sum());
  }
  return longest;
}

bool RegistrationLevel::AddLights(const FramesToRegister& input, const Eigen::Vector2d& cell,
                                  Tile& tile) const {
  Matrix l(count_, 3);
  tile.e.resize(count_);
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Eigen::Vector3d el = input.light(static_cast<size_t>(k), cell);
    tile.e[k] = el.norm();
    if (!(tile.e[k] > 0.0)) {
      return false;
    }
    l.row(k) = el.transpose() / tile.e[k];
  }
  const Eigen::Matrix3d ltl = l.transpose() * l;
  if (!(LeastPivot(ltl) > 1e-3)) {
    return false;  // lights in one plane tell of no N
  }
  tile.n_from_v = l * InverseOfSymmetric(ltl);
  tile.p = Matrix::Identity(count_, count_) - tile.n_from_v * l.transpose();
  return true;
}

void RegistrationLevel::Move(const std::vector<Eigen::Vector2d>& shifts) {
  moved_.resize(high_.size());
  for (size_t k = 0; k < high_.size(); ++k) {
    moved_[k] = Moved(high_[k], shifts[k]);
  }
}

void RegistrationLevel::Gather(const Tile& tile, bool with_gradients) {
  const Eigen::Index most = static_cast<Eigen::Index>((tile.right - tile.left)) *
                            static_cast<Eigen::Index>((tile.bottom - tile.top));
  v_.resize(most, count_);
  regressors_.resize(most, 2 * count_ + 3);
  bright_here_.resize(most);
  Eigen::Index cells = 0;
  for (int y = tile.top; y < tile.bottom; ++y) {
    for (int x = tile.left; x < tile.right; ++x) {
      cells += AddCell(tile, x, y, cells, with_gradients) ? 1 : 0;
    }
  }
  v_.conservativeResize(cells, count_);
  regressors_.conservativeResize(cells, 2 * count_ + 3);
  pv_ = v_ * tile.p;
  misfit2_ = pv_.rowwise().squaredNorm();
  bright_here_.conservativeResize(cells);
  r_ = misfit2_.cwiseSqrt().cwiseQuotient(bright_here_) * tile.e.mean();
  if (with_gradients && cells > 0) {
    regressors_.rightCols(3) = v_ * tile.n_from_v;                            // N'
    w_ = (1.0 + r_.array().square() / (scale_ * scale_)).square().inverse();  // (3)
  }
}

bool RegistrationLevel::AddCell(const Tile& tile, int x, int y, Eigen::Index cell,
                                bool with_gradients) {
  bright_here_[cell] = static_cast<double>(bright_.At(x, y));
  if (!(bright_here_[cell] > 0.0)) {
    return false;  // not known in a frame, or dark
  }
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Image<float>& frame = moved_[static_cast<size_t>(k)];
    const auto value = static_cast<double>(frame.At(x, y));
    const double dx =
        Slope(frame.At(x - 2, y), frame.At(x - 1, y), frame.At(x + 1, y), frame.At(x + 2, y));
    const double dy =
        Slope(frame.At(x, y - 2), frame.At(x, y - 1), frame.At(x, y + 1), frame.At(x, y + 2));
    if (!std::isfinite(value + dx + dy)) {
      return false;
    }
    v_(cell, k) = value / tile.e[k];
    if (with_gradients) {
      regressors_(cell, k) = -dx / tile.e[k];
      regressors_(cell, count_ + k) = -dy / tile.e[k];
    }
  }
  return true;
}

RegistrationLevel::Vector RegistrationLevel::Accumulate(const Tile& tile,
                                                        NormalEquations& all) const {
  const Matrix weighted = w_.asDiagonal() * regressors_;
  const Matrix s = regressors_.transpose() * weighted;
  const Matrix c = weighted.transpose() * pv_;
  const auto column = [&](Eigen::Index k, Eigen::Index u) {
    return u < 2 ? u * count_ + k : 2 * count_ + u - 2;
  };
  Vector b(kUnknowns * count_);
  for (Eigen::Index k = 0; k < count_; ++k) {
    for (Eigen::Index u = 0; u < kUnknowns; ++u) {
      b[kUnknowns * k + u] = c(column(k, u), k);
      for (Eigen::Index m = 0; m <= k; ++m) {
        for (Eigen::Index t = 0; t < kUnknowns; ++t) {
          all.a(kUnknowns * k + u, kUnknowns * m + t) +=
              tile.p(k, m) * s(column(k, u), column(m, t));
        }
      }
    }
  }
  all.b += b;
  return b;
}

void RegistrationLevel::AddRidge(double variance, Matrix& a) const {
  a.triangularView<Eigen::StrictlyUpper>() = a.transpose();
  const double of_light = variance / (kLightError * kLightError);
  const double of_step = variance / (kMostCells * kMostCells);
  const double hold = 1e6 * std::max(a.diagonal().maxCoeff(), 1e-30);
  for (Eigen::Index k = 0; k < count_; ++k) {
    a.diagonal().segment<2>(kUnknowns * k).array() += k == 0 ? hold : of_step;
    a.diagonal().segment<3>(kUnknowns * k + 2).array() += of_light;
  }
}

double RegistrationLevel::MisfitScale() {
  std::vector<double> all;
  for (const Tile& tile : tiles_) {
    Gather(tile, /*with_gradients=*/false);
    all.insert(all.end(), r_.begin(), r_.end());
  }
  if (all.empty()) {
    return 1.0;
  }
  return std::max(2.0 * Median(std::move(all)), 1e-9);
}

}  // namespace sateen
