#include "bench/comparators/comparators.h"

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <utility>

#include "core/linear_algebra.h"
#include "imaging/color.h"
#include "solver/least_squares/pixel_system.h"

namespace sateen {
namespace {

using Estimator =
    std::function<Eigen::Vector3d(const Eigen::MatrixX3d& l, const Eigen::VectorXd& i)>;

constexpr int kSteps = 30;
constexpr size_t kMostForSparseBayesian = 20;  // its time grows with the cube of the lights

// Weighted least squares again and again, by LDLT; `weight` of the absolute residual.
Estimator Reweighted(std::function<double(double residual, double scale)> weight) {
  return [weight = std::move(weight)](const Eigen::MatrixX3d& l, const Eigen::VectorXd& i) {
    Eigen::Vector3d n = SolveNormalEquations(l, i);
    for (int step = 0; step < kSteps; ++step) {
      const Eigen::VectorXd r = (i - l * n).cwiseAbs();
      const Eigen::VectorXd w =
          r.unaryExpr([&](double residual) { return weight(residual, i.maxCoeff()); });
      const Eigen::VectorXd root = w.cwiseSqrt();
      n = SolveNormalEquations(Eigen::MatrixX3d(root.asDiagonal() * l),
                               Eigen::VectorXd(root.cwiseProduct(i)));
    }
    return n;
  };
}

// Equations 9 to 12 of "Robust photometric stereo using sparse regression": i = l n + e + noise,
// with a variance for each entry of e by expectation maximisation.
Eigen::Vector3d SparseBayesian(const Eigen::MatrixX3d& l, const Eigen::VectorXd& samples) {
  const Eigen::Index count = l.rows();
  const double scale = samples.mean();
  const Eigen::VectorXd i = samples / scale;
  constexpr double kNoise = 1e-6;
  constexpr double kDiffuseVariance = 1e6;
  Eigen::VectorXd gamma = Eigen::VectorXd::Ones(count);
  Eigen::VectorXd e = Eigen::VectorXd::Zero(count);
  for (int step = 0; step < 100; ++step) {
    Eigen::MatrixXd sigma = kDiffuseVariance * l * l.transpose();
    sigma.diagonal() += gamma + Eigen::VectorXd::Constant(count, kNoise);
    const Eigen::MatrixXd inverse = InverseOfSymmetric(sigma);
    e = gamma.cwiseProduct(inverse * i);
    const Eigen::VectorXd variance =
        gamma - gamma.cwiseProduct(inverse.diagonal()).cwiseProduct(gamma);
    gamma = (e.cwiseAbs2() + variance).cwiseMax(1e-12);
  }
  return scale * SolveByQr(l, i - e);
}

Estimator EstimatorOf(Comparator comparator) {
  switch (comparator) {
    case Comparator::kHuber:
      return Reweighted(
          [](double r, double scale) { return std::min(1.0, 0.01 * scale / std::max(r, 1e-12)); });
    case Comparator::kL1:
      return Reweighted([](double r, double scale) { return 1.0 / std::max(r, 1e-6 * scale); });
    case Comparator::kSparseBayesian:
      return SparseBayesian;
    default:
      return [](const Eigen::MatrixX3d& l, const Eigen::VectorXd& i) {
        return SolveNormalEquations(l, i);
      };
  }
}

bool IsInside(const std::optional<Mask>& mask, size_t pixel) {
  return !mask || mask->pixels[pixel] != 0;
}

void StoreNormal(const Eigen::Vector3d& n, size_t pixel, NormalField& field) {
  const bool has_answer = n.allFinite() && !n.isZero();
  field.reason.pixels[pixel] =
      static_cast<uint8_t>(has_answer ? Reason::kSolved : Reason::kIllConditioned);
  for (size_t c = 0; c < 3; ++c) {
    field.normal[c].pixels[pixel] =
        has_answer ? static_cast<float>(n.normalized()[static_cast<Eigen::Index>(c)]) : 0.0F;
  }
}

void SolvePerPixel(const Estimator& estimate, const LightStack& stack, const Rig& rig,
                   const std::optional<Mask>& mask, NormalField& field) {
  const LambertianOptions options;
  PixelSystem system({stack, rig, mask}, options);
  for (int y = 0; y < field.reason.height; ++y) {
    for (int x = 0; x < field.reason.width; ++x) {
      const size_t pixel = field.reason.Index(x, y);
      if (!IsInside(mask, pixel)) {
        continue;
      }
      system.Gather(x, y);
      if (system.SampleReason() == Reason::kSolved) {
        StoreNormal(estimate(system.L(), system.Rhs().col(3)), pixel, field);
      }
    }
  }
}

void SolveWholeImage(const LightStack& stack, const Rig& rig, const std::optional<Mask>& mask,
                     NormalField& field) {
  const auto lights = static_cast<Eigen::Index>(stack.size());
  std::vector<size_t> pixels;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    if (IsInside(mask, p)) {
      pixels.push_back(p);
    }
  }
  Eigen::MatrixXd l(lights, 3);
  Eigen::MatrixXd i(lights, static_cast<Eigen::Index>(pixels.size()));
  const Eigen::Vector3d luminance = Eigen::Vector3f(kLuminance.data()).cast<double>();
  for (Eigen::Index k = 0; k < lights; ++k) {
    const Light& light = rig.lights[static_cast<size_t>(k)];
    const Image3& rgb = stack[static_cast<size_t>(k)].rgb;
    l.row(k) = light.direction.transpose();
    for (size_t j = 0; j < pixels.size(); ++j) {
      const Eigen::Vector3f sample(rgb[0].pixels[pixels[j]], rgb[1].pixels[pixels[j]],
                                   rgb[2].pixels[pixels[j]]);
      i(k, static_cast<Eigen::Index>(j)) =
          sample.cast<double>().cwiseQuotient(light.flux_rgb).dot(luminance);
    }
  }
  // Eigen's bdcSvd leaves matrices of fewer than 16 columns to JacobiSVD.
  const Eigen::MatrixXd n = SolveBySvd(l, i).x;
  for (size_t j = 0; j < pixels.size(); ++j) {
    StoreNormal(n.col(static_cast<Eigen::Index>(j)), pixels[j], field);
  }
}

}  // namespace

std::string_view Name(Comparator comparator) {
  switch (comparator) {
    case Comparator::kBdcSvd:
      return "bdcSvd, all samples";
    case Comparator::kLeastSquares:
      return "LDLT a pixel";
    case Comparator::kHuber:
      return "Huber";
    case Comparator::kL1:
      return "L1";
    case Comparator::kSparseBayesian:
      return "sparse Bayesian";
  }
  return "";
}

std::vector<Comparator> ComparatorsFor(const Rig& rig) {
  std::vector<Comparator> comparators = {Comparator::kLeastSquares, Comparator::kHuber,
                                         Comparator::kL1};
  if (std::ranges::all_of(rig.lights,
                          [](const Light& light) { return light.model == LightModel::kDistant; })) {
    comparators.insert(comparators.begin(), Comparator::kBdcSvd);
  }
  if (rig.lights.size() <= kMostForSparseBayesian) {
    comparators.push_back(Comparator::kSparseBayesian);
  }
  return comparators;
}

NormalField SolveBy(Comparator comparator, const LightStack& stack, const Rig& rig,
                    const std::optional<Mask>& mask) {
  NormalField field;
  field.Resize(stack[0].rgb.Size());
  if (comparator == Comparator::kBdcSvd) {
    SolveWholeImage(stack, rig, mask, field);
  } else {
    SolvePerPixel(EstimatorOf(comparator), stack, rig, mask, field);
  }
  return field;
}

}  // namespace sateen
