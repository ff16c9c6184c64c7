#include "scanner/checks/shade_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/linear_algebra.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr size_t kFewestFrames = 6;  // three for N, and most of the others must agree
constexpr size_t kFewest = 5;        // neighbouring blocks, of 24 x 16
constexpr double kAbove = 2.5;
constexpr int kRobustSteps = 8;
constexpr double kDarkest = 0.02;     // least brightness of what is predicted that is looked at
constexpr double kPlaneError = 0.04;  // from the middle to the border, by a wrong position
constexpr double kNoise = 0.02;       // noise of a block, for the ridge that holds the plane
constexpr Eigen::Index kTerms = 9;    // terms of f: a cubic without its constant

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Returns the quantile of the known values, or unknown if no value is known.
double KnownQuantile(std::vector<double> values, double share) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  return values.empty() ? kUnknown : Quantile(std::move(values), share);
}

Eigen::Matrix<double, kTerms, 1> CubicOf(const Eigen::Vector2d& h) {
  const double x = h.x();
  const double y = h.y();
  return {x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y};
}

class ShadeFinder {
 public:
  ShadeFinder(const FramesToShade& frames, double min_depth)
      : in_(frames),
        min_depth_(min_depth),
        count_(frames.signal.size()),
        blocks_(frames.view.size()),
        level_(count_, 1.0),
        y_(count_, BlockField(blocks_, kUnknown)) {}

  double Misfit() {
    if (count_ < kFewestFrames || !PredictAll()) {
      return std::numeric_limits<double>::infinity();
    }
    double sum = 0.0;
    double count = 0.0;
    for (const BlockField& field : y_) {
      for (const double y : field) {
        sum += std::isfinite(y) ? std::abs(y) : 0.0;
        count += std::isfinite(y) ? 1.0 : 0.0;
      }
    }
    return sum / count;
  }

  std::vector<std::optional<Shade>> Find() {
    if (count_ < kFewestFrames) {
      return {};
    }
    if (!PredictAll()) {
      return {};
    }
    TakeOutMaterial();
    std::vector<BlockField> depths;
    std::vector<double> strength;
    for (size_t k = 0; k < count_; ++k) {
      depths.push_back(DepthOf(y_[k]));
      strength.push_back(StrengthOf(depths[k]));
    }
    const double least = std::max(-std::log1p(-min_depth_), kAbove * KnownQuantile(strength, 0.5));
    std::vector<std::optional<Shade>> shades(count_);
    for (size_t k = 0; k < count_; ++k) {
      if (strength[k] > least) {
        shades[k] = Describe(depths[k], 0.5 * strength[k]);
      }
    }
    return shades;
  }

 private:
  // Solves (1). Levels come first, or a light of another brightness than the rig says would bend
  // every N.
  bool PredictAll() {
    for (int round = 0; round < 2; ++round) {
      for (size_t b = 0; b < blocks_; ++b) {
        Predict(b);
      }
      for (size_t k = 0; k < count_; ++k) {
        const double level = KnownQuantile(y_[k], 0.5);
        if (!std::isfinite(level)) {
          return false;
        }
        level_[k] *= round == 0 ? std::exp(level) : 1.0;
      }
    }
    return true;
  }

  // Solves (1) at one block.
  void Predict(size_t b) {
    const auto rows = static_cast<Eigen::Index>(count_);
    Eigen::MatrixXd l(rows, 3);
    Eigen::VectorXd i(rows);
    for (size_t k = 0; k < count_; ++k) {
      const Eigen::Vector3d& el = in_.light[k][b];
      const double e = el.norm();
      const auto row = static_cast<Eigen::Index>(k);
      if (!(e > 0.0)) {
        return;
      }
      l.row(row) = el.transpose() / e;
      i[row] = in_.signal[k][b] / (e * level_[k]);
    }
    const double scale = i.cwiseAbs().mean();
    if (!(scale > 0.0)) {
      return;
    }
    Eigen::VectorXd w = Eigen::VectorXd::Ones(rows);
    Eigen::Vector3d n = Eigen::Vector3d::Zero();
    for (int step = 0; step < kRobustSteps; ++step) {
      const Eigen::Matrix3d a = l.transpose() * w.asDiagonal() * l;
      if (!(LeastPivot(a) > 1e-6)) {
        return;
      }
      n = SolveSymmetric(a, Eigen::Vector3d(l.transpose() * w.cwiseProduct(i)));
      w = (i - l * n).cwiseAbs().cwiseMax(1e-3 * scale).cwiseInverse() * scale;
    }
    const Eigen::VectorXd predicted = l * n;
    for (size_t k = 0; k < count_; ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      const bool is_lit = predicted[row] > kDarkest * scale;
      y_[k][b] = is_lit ? std::log(std::max(i[row], kDarkest * scale) / predicted[row]) : kUnknown;
    }
  }

  [[nodiscard]] Eigen::Vector2d HalfVector(size_t k, size_t b) const {
    return (in_.light[k][b].normalized() + in_.view[b]).normalized().head<2>();
  }

  // Takes out f and c_k of (2), with weights against what lies on a frame.
  void TakeOutMaterial() {
    const auto frames = static_cast<Eigen::Index>(count_);
    const Eigen::Index size = kTerms + frames;
    Eigen::VectorXd theta = Eigen::VectorXd::Zero(size);
    for (int step = 0; step < 5; ++step) {
      Eigen::MatrixXd a = 1e-6 * Eigen::MatrixXd::Identity(size, size);
      Eigen::VectorXd rhs = Eigen::VectorXd::Zero(size);
      Eigen::VectorXd x(size);
      for (size_t k = 0; k < count_; ++k) {
        for (size_t b = 0; b < blocks_; ++b) {
          if (!std::isfinite(y_[k][b])) {
            continue;
          }
          x.setZero();
          x.head<kTerms>() = CubicOf(HalfVector(k, b));
          x[kTerms + static_cast<Eigen::Index>(k)] = 1.0;
          const double r = y_[k][b] - x.dot(theta);
          const double w = step == 0 ? 1.0 : 1.0 / std::max(std::abs(r), kNoise);
          a.selfadjointView<Eigen::Lower>().rankUpdate(x, w);
          rhs += w * y_[k][b] * x;
        }
      }
      theta = SolveSymmetric(a, rhs);
    }
    for (size_t k = 0; k < count_; ++k) {
      for (size_t b = 0; b < blocks_; ++b) {
        y_[k][b] -= CubicOf(HalfVector(k, b)).dot(theta.head<kTerms>());
      }
    }
  }

  // Returns the place of a block, from -1 to 1 over the picture.
  [[nodiscard]] Eigen::Vector2d PlaceOf(size_t b) const {
    const auto columns = static_cast<size_t>(in_.grid.columns);
    const size_t row = b / columns;
    return {2.0 * (static_cast<double>(b % columns) + 0.5) / in_.grid.columns - 1.0,
            2.0 * (static_cast<double>(row) + 0.5) / in_.grid.rows - 1.0};
  }

  // Returns the depth of z of (2) below its upper quarter.
  [[nodiscard]] BlockField DepthOf(BlockField z) const {
    Eigen::Vector3d plane = Eigen::Vector3d::Zero();
    for (int step = 0; step < 8; ++step) {
      Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
      Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
      double weights = 0.0;
      for (size_t b = 0; b < blocks_; ++b) {
        if (std::isfinite(z[b])) {
          const Eigen::Vector3d x = PlaceOf(b).homogeneous();
          const double w = kNoise / std::max(std::abs(z[b] - x.dot(plane)), kNoise);
          a += w * x * x.transpose();
          rhs += w * z[b] * x;
          weights += w;
        }
      }
      const double ridge = 0.02 * weights * kNoise * kNoise / (kPlaneError * kPlaneError);
      a.diagonal() += Eigen::Vector3d(ridge, ridge, 1e-9);
      plane = SolveSymmetric(a, rhs);
      plane.head<2>() = plane.head<2>().cwiseMax(-kPlaneError).cwiseMin(kPlaneError).eval();
    }
    for (size_t b = 0; b < blocks_; ++b) {
      z[b] -= PlaceOf(b).homogeneous().dot(plane);
    }
    z = Smoothed(z);
    const double top = KnownQuantile(z, 0.75);
    std::ranges::transform(z, z.begin(), [&](double value) { return top - value; });
    return z;
  }

  // Returns the 3 x 3 median.
  [[nodiscard]] BlockField Smoothed(const BlockField& z) const {
    BlockField smooth(blocks_, kUnknown);
    std::vector<double> near;
    for (int y = 0; y < in_.grid.rows; ++y) {
      for (int x = 0; x < in_.grid.columns; ++x) {
        near.clear();
        for (int v = std::max(0, y - 1); v <= std::min(in_.grid.rows - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); u <= std::min(in_.grid.columns - 1, x + 1); ++u) {
            near.push_back(z[At(u, v)]);
          }
        }
        smooth[At(x, y)] = KnownQuantile(near, 0.5);
      }
    }
    return smooth;
  }

  [[nodiscard]] size_t At(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(in_.grid.columns) + static_cast<size_t>(x);
  }

  static size_t RootOf(std::vector<size_t>& parent, size_t b) {
    while (parent[b] != b) {
      parent[b] = parent[parent[b]];
      b = parent[b];
    }
    return b;
  }

  // Returns D: neighbouring blocks join from the deepest up, until kFewest are together.
  [[nodiscard]] double StrengthOf(const BlockField& depth) const {
    std::vector<size_t> order;
    for (size_t b = 0; b < blocks_; ++b) {
      if (std::isfinite(depth[b])) {
        order.push_back(b);
      }
    }
    std::ranges::stable_sort(order, [&](size_t a, size_t b) { return depth[a] > depth[b]; });
    std::vector<size_t> parent(blocks_);
    std::iota(parent.begin(), parent.end(), size_t{0});
    std::vector<size_t> members(blocks_, 0);  // 0: not there yet
    const auto columns = static_cast<size_t>(in_.grid.columns);
    for (const size_t b : order) {
      members[b] = 1;
      const auto join = [&](size_t other) {
        const size_t root = RootOf(parent, b);
        const size_t of_other = RootOf(parent, other);
        if (members[other] > 0 && root != of_other) {
          parent[of_other] = root;
          members[root] += members[of_other];
        }
      };
      if (b % columns > 0) {
        join(b - 1);
      }
      if (b % columns + 1 < columns) {
        join(b + 1);
      }
      if (b >= columns) {
        join(b - columns);
      }
      if (b + columns < blocks_) {
        join(b + columns);
      }
      if (members[RootOf(parent, b)] >= kFewest) {
        return depth[b];
      }
    }
    return 0.0;
  }

  [[nodiscard]] Shade Describe(const BlockField& depth, double least) const {
    Shade shade;
    std::vector<double> depths;
    for (size_t b = 0; b < blocks_; ++b) {
      if (depth[b] > least) {
        depths.push_back(depth[b]);
        shade.middle += 0.5 * (PlaceOf(b).array() + 1.0).matrix();
      }
    }
    shade.share = static_cast<double>(depths.size()) / static_cast<double>(blocks_);
    shade.middle /= static_cast<double>(depths.size());
    shade.depth = 1.0 - std::exp(-KnownQuantile(depths, 0.5));
    return shade;
  }

  const FramesToShade& in_;
  double min_depth_;
  size_t count_;
  size_t blocks_;
  std::vector<double> level_;  // brightness per light, relative to the rig's
  std::vector<BlockField> y_;  // y of (1), then z of (2)
};

}  // namespace

std::vector<std::optional<Shade>> FindShades(const FramesToShade& frames, double min_depth) {
  return ShadeFinder(frames, min_depth).Find();
}

double MisfitOfLights(const FramesToShade& frames) { return ShadeFinder(frames, 1.0).Misfit(); }

}  // namespace sateen
