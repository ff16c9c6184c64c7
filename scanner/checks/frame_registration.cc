#include "scanner/checks/frame_registration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/linear_algebra.h"
#include "scanner/checks/registration_images.h"

namespace sateen {
namespace {

constexpr int kMargin = 2;            // cells that a derivative takes to each side
constexpr int kTile = 8;              // cells along each side
constexpr int kFewestTileCells = 32;  // along each side of the picture
constexpr int kLevels = 4;            // of the pyramid, each half of the one before
constexpr int kMostSteps = 6;         // of Gauss-Newton on a level
constexpr double kSmallCells = 0.01;  // a step that ends a level
constexpr double kLightError = 0.3;   // a of (1), of |l|
constexpr double kMostCells = 1.5;    // that one step may go: beyond that (1) is no longer linear
constexpr double kPxOfCell = 2.0;
constexpr Eigen::Index kUnknowns = 5;  // of a frame: dx, dy, and a

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

// Of the parabola of fourth order: a difference of two neighbours would be a third too small for a
// texture of 4 cells, and the steps that much too large.
double Slope(float before2, float before, float after, float after2) {
  return (8.0 * static_cast<double>(after - before) - static_cast<double>(after2 - before2)) / 12.0;
}

// What (2) adds up of one tile, or of all.
struct NormalEquations {
  Matrix a;
  Vector b;
};

// One level of the pyramid.
class Level {
 public:
  Level(const std::vector<Image<float>>& frames, const FramesToRegister& input, double cells)
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

  [[nodiscard]] bool IsEmpty() const { return tiles_.empty(); }

  // sum of r: how badly the frames fit together at these shifts, in cells of this level.
  [[nodiscard]] double Misfit(const std::vector<Eigen::Vector2d>& shifts) {
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

  // The share of the frames' variance that a surface explains, at the shifts of the last Misfit(): 0
  // where there is only noise.
  [[nodiscard]] double Explained() const { return explained_; }

  // One step of Gauss-Newton from `shifts`; returns the longest, in cells.
  double Step(std::vector<Eigen::Vector2d>& shifts, std::vector<double>& sd) {
    Move(shifts);
    scale_ = MedianMisfit();
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

 private:
  struct Tile {
    int left, top, right, bottom;
    Vector e;         // |e_k|
    Matrix p;         // the projector
    Matrix n_from_v;  // L (L^T L)^-1
  };

  bool AddLights(const FramesToRegister& input, const Eigen::Vector2d& cell, Tile& tile) const {
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

  void Move(const std::vector<Eigen::Vector2d>& shifts) {
    moved_.resize(high_.size());
    for (size_t k = 0; k < high_.size(); ++k) {
      moved_[k] = Moved(high_[k], shifts[k]);
    }
  }

  // v, r, the misfit P v and, where asked, gradients and weights, of the finite cells of a tile.
  void Gather(const Tile& tile, bool with_gradients) {
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

  bool AddCell(const Tile& tile, int x, int y, Eigen::Index cell, bool with_gradients) {
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

  // Adds one tile's share of (2) and returns its b.
  Vector Accumulate(const Tile& tile, NormalEquations& all) const {
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

  // d_1 = 0; a and, so that without texture nothing moves, the steps are held.
  void AddRidge(double variance, Matrix& a) const {
    a.triangularView<Eigen::StrictlyUpper>() = a.transpose();
    const double of_light = variance / (kLightError * kLightError);
    const double of_step = variance / (kMostCells * kMostCells);
    const double hold = 1e6 * std::max(a.diagonal().maxCoeff(), 1e-30);
    for (Eigen::Index k = 0; k < count_; ++k) {
      a.diagonal().segment<2>(kUnknowns * k).array() += k == 0 ? hold : of_step;
      a.diagonal().segment<3>(kUnknowns * k + 2).array() += of_light;
    }
  }

  double MedianMisfit() {
    std::vector<double> all;
    for (const Tile& tile : tiles_) {
      Gather(tile, /*with_gradients=*/false);
      all.insert(all.end(), r_.begin(), r_.end());
    }
    if (all.empty()) {
      return 1.0;
    }
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    return std::max(2.0 * *middle, 1e-9);
  }

  Eigen::Index count_;
  std::vector<Image<float>> high_;  // the frames, less their local mean
  Image<float> bright_;             // mean of the frames
  std::vector<Tile> tiles_;
  std::vector<Image<float>> moved_;
  double scale_ = 1.0;  // s of (3)
  double explained_ = 0.0;
  // Of the tile that was gathered last, one row a cell.
  Matrix v_;
  Matrix regressors_;  // -d/dx of each frame, -d/dy of each, N'
  Matrix pv_;
  Vector bright_here_;
  Vector misfit2_;
  Vector r_;
  Vector w_;
};

std::vector<Level> PyramidOf(const FramesToRegister& input) {
  std::vector<Image<float>> frames;
  for (const Image<float>* frame : input.frames) {
    frames.push_back(*frame);
  }
  std::vector<Level> levels;
  double cells = 1.0;
  while (levels.size() < kLevels &&
         std::min(frames[0].width, frames[0].height) >= kFewestTileCells) {
    levels.emplace_back(frames, input, cells);
    std::ranges::transform(frames, frames.begin(), Halved);
    cells *= 2.0;
  }
  return levels;
}

class Registration {
 public:
  explicit Registration(const FramesToRegister& input)
      : levels_(PyramidOf(input)), sd_(input.frames.size(), 0.0) {}

  [[nodiscard]] bool CanTell() const { return !levels_.empty() && !levels_[0].IsEmpty(); }

  // From `shifts`, in cells, through the `levels` finest levels.
  void Refine(size_t levels, std::vector<Eigen::Vector2d> shifts) {
    for (size_t level = std::min(levels, levels_.size()); level-- > 0;) {
      const double cells = std::pow(2.0, static_cast<double>(level));
      for (Eigen::Vector2d& shift : shifts) {
        shift /= cells;
      }
      for (int step = 0; step < kMostSteps; ++step) {
        if (levels_[level].Step(shifts, sd_) < kSmallCells) {
          break;
        }
      }
      for (Eigen::Vector2d& shift : shifts) {
        shift *= cells;
      }
    }
    const double misfit = levels_[0].Misfit(shifts);
    if (best_.empty() || misfit < misfit_) {
      misfit_ = misfit;
      explained_ = levels_[0].Explained();
      best_ = std::move(shifts);
      best_sd_ = sd_;
    }
  }

  // All frames from one on have moved like the last: the best such start.
  std::vector<Eigen::Vector2d> BestStart(const Eigen::Vector2d& last) {
    std::vector<Eigen::Vector2d> best;
    double least = 0.0;
    for (size_t from = 1; from < sd_.size(); ++from) {
      std::vector<Eigen::Vector2d> shifts(sd_.size(), Eigen::Vector2d::Zero());
      std::fill(shifts.begin() + static_cast<std::ptrdiff_t>(from), shifts.end(), last);
      const double misfit = levels_[0].Misfit(shifts);
      if (best.empty() || misfit < least) {
        least = misfit;
        best = std::move(shifts);
      }
    }
    return best;
  }

  [[nodiscard]] double Explained() const { return explained_; }

  [[nodiscard]] std::vector<Shift> Shifts() const {
    std::vector<Shift> shifts(best_.size(), Shift{.sd_px = 0.0});
    for (size_t k = 1; k < best_.size(); ++k) {
      shifts[k] = {.px = kPxOfCell * best_[k], .sd_px = kPxOfCell * best_sd_[k]};
    }
    return shifts;
  }

 private:
  std::vector<Level> levels_;
  std::vector<double> sd_;
  std::vector<Eigen::Vector2d> best_;
  std::vector<double> best_sd_;
  double misfit_ = 0.0;
  double explained_ = 0.0;
};

// (4); l and d relative to the first frame's.
void TakeOutGloss(const std::vector<Eigen::Vector2d>& l, std::vector<Shift>& shifts) {
  constexpr int kSteps = 30;
  constexpr double kLeastPx = 0.005;
  const size_t count = shifts.size();
  Eigen::Matrix2d b = Eigen::Matrix2d::Zero();
  std::vector<double> left(count - 1);
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix2d ll = 1e-9 * Eigen::Matrix2d::Identity();
    Eigen::Matrix2d dl = Eigen::Matrix2d::Zero();
    for (size_t k = 1; k < count; ++k) {
      const Eigen::Vector2d of_light = l[k] - l[k - 1];
      const Eigen::Vector2d jump = shifts[k].px - shifts[k - 1].px;
      left[k - 1] = (jump - b * of_light).norm();
      const double w = 1.0 / std::max(left[k - 1], kLeastPx);
      ll += w * of_light * of_light.transpose();
      dl += w * jump * of_light.transpose();
    }
    b = dl * ll.inverse();
  }
  const auto middle = left.begin() + static_cast<std::ptrdiff_t>(left.size() / 2);
  std::nth_element(left.begin(), middle, left.end());
  for (size_t k = 1; k < count; ++k) {
    shifts[k].px -= b * l[k];
    // The repeat, of the same light, is free of it.
    shifts[k].sd_px = std::hypot(shifts[k].sd_px, k + 1 < count ? *middle : 0.0);
  }
}

}  // namespace

bool IsSignificant(const Shift& shift) {
  constexpr double kLeastPx = 0.05;
  return shift.px.norm() > std::max(kLeastPx, 3.0 * shift.sd_px);
}

std::vector<Shift> RegisterFrames(const FramesToRegister& input, double min_peak) {
  constexpr size_t kFewestFrames = 5;
  constexpr double kFarPx = 0.7;
  std::vector<Shift> nothing(input.frames.size());
  if (input.frames.size() < kFewestFrames) {
    return nothing;
  }
  const Correlation last = ShiftBetween(*input.frames.front(), *input.frames.back());
  if (!(last.peak >= min_peak)) {
    return nothing;
  }
  Registration registration(input);
  if (!registration.CanTell()) {
    return nothing;
  }
  registration.Refine(kLevels,
                      std::vector<Eigen::Vector2d>(input.frames.size(), Eigen::Vector2d::Zero()));
  if (last.px.norm() > kFarPx) {
    registration.Refine(1, registration.BestStart(last.px / kPxOfCell));
  }
  if (registration.Explained() < min_peak) {
    return nothing;  // first and last frame have the same noise, and nothing else in common
  }
  std::vector<Shift> shifts = registration.Shifts();
  const Image<float>& first = *input.frames.front();
  const Eigen::Vector2d middle(0.5 * first.width, 0.5 * first.height);
  std::vector<Eigen::Vector2d> l;
  for (size_t k = 0; k < input.frames.size(); ++k) {
    l.emplace_back(input.light(k, middle).normalized().head<2>());
  }
  for (size_t k = l.size(); k-- > 0;) {
    l[k] -= l[0];
  }
  TakeOutGloss(l, shifts);
  return shifts;
}

}  // namespace sateen
