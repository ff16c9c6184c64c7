#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

// Result of one descent.
struct LightDescent {
  Light light;
  int iterations = 0;
  // Covariance of position and log flux, 6 x 6, for residuals of variance 1; empty unless asked
  // for.
  Eigen::MatrixXd covariance = {};
};

/// Residuals of samples of white paper under one light, and their minimum:
///
///     r_jc = (rho e_c(x_j) max(0, n_j . l(x_j)) - i_jc) / sd_jc                           (1)
///
/// with l and e of rig/light.h. Derivatives are Ceres' automatic ones. Unknowns are the position
/// and the logarithm of the flux; an LED also has its axis, as a point on the sphere, and its
/// fall-off.
///
/// samples  must outlive the object
/// albedo   rho of the paper
class LightResiduals {
 public:
  LightResiduals(const std::vector<SheetSample>& samples, double albedo)
      : samples_(samples), albedo_(albedo) {}

  [[nodiscard]] const std::vector<SheetSample>& Samples() const { return samples_; }

  // Returns (1) of the samples of these indices, three per sample.
  [[nodiscard]] std::vector<double> Of(const Light& light,
                                       const std::vector<size_t>& indices) const;

  /// Returns the noise in units of sd_rgb: the robust spread of differences between the residuals
  /// of neighbours. An error of the model hardly changes it.
  [[nodiscard]] double NoiseRms(const Light& light, const std::vector<size_t>& indices) const;

  /// Minimizes (1) from `start` on the rung `model`, by Levenberg and Marquardt's method.
  ///
  /// loss_scale  scale of Cauchy's loss in units of sd_rgb; 0: least squares
  /// Errors      kDegenerate: no usable solution; a covariance that the samples do not determine
  [[nodiscard]] Result<LightDescent> Descend(LightModel model, const Light& start,
                                             const std::vector<size_t>& indices, double loss_scale,
                                             bool with_covariance = false) const;

 private:
  const std::vector<SheetSample>& samples_;
  double albedo_;
};

}  // namespace sateen
