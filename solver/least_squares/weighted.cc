#include "solver/least_squares/weighted.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/linear_algebra.h"

namespace sateen {
namespace {

constexpr float kMarked = -1.0F;
constexpr double kLeastVarianceShare = 1e-6;  // for channels without noise

}  // namespace

NormalVariances VariancesOf(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& n) {
  const double squared = n.squaredNorm();
  const double along = n.dot(covariance * n) / squared;
  return {std::max(0.0, covariance.trace() - along) / squared, std::max(0.0, along) / squared};
}

WeightedAnswer PlainWeighted(const PixelSystem& system, const StackNoise& noise) {
  const auto l = system.L();
  const Eigen::Vector3d n = SolveNormalEquations(l, Eigen::VectorXd(system.Rhs().col(3)));
  WeightedAnswer answer;
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
  const NormalVariances of_n = VariancesOf(covariance, answer.n);  // (4)
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

void MarkPending(Reason which, int row_begin, int row_end, const NormalField& field,
                 std::span<float> misfits) {
  const size_t first = field.reason.Index(0, row_begin);
  for (size_t p = first; p < field.reason.Index(0, row_end); ++p) {
    if (field.reason.pixels[p] == static_cast<uint8_t>(which)) {
      misfits[p - first] = kMarked;
    }
  }
}

void WeighRowsInDouble(const FramesInput& input, const LambertianOptions& options,
                       const StackNoise& noise, double noise_scale, int row_begin, int row_end,
                       NormalField& field, std::span<float> misfits) {
  PixelSystem system(input, options);
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
    const WeightedAnswer answer = PlainWeighted(system, noise);
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
    // An infinite scale may give NaN: std::min in this order then returns the bound.
    field.uncertainty.pixels[pixel] =
        static_cast<float>(std::min(180.0, answer.uncertainty_deg * noise_scale));
    field.albedo_uncertainty.pixels[pixel] =
        static_cast<float>(std::min(1.0, answer.albedo_uncertainty * noise_scale));
    misfit = static_cast<float>(answer.misfit);
  }
}

}  // namespace sateen
