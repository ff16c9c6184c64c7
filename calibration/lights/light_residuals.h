#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

// What one descent came to.
struct LightDescent {
  Light light;
  int iterations = 0;
  // Of position and log flux, 6 x 6, for residuals of variance 1; empty unless it was asked for.
  Eigen::MatrixXd covariance = {};
};

/// How far samples of white paper lie off one light, and the light that makes that least:
///
///     r_jc = (rho e_c(x_j) max(0, n_j . l(x_j)) - i_jc) / sd_jc                           (1)
///
/// with l and e of rig/light.h. Derivatives are Ceres' automatic ones. Unknowns are the position,
/// the logarithm of the flux, and on the rung of an LED the axis as a point of the sphere and the
/// fall-off.
///
/// samples  outlive the object
/// albedo   rho, of the paper
class LightResiduals {
 public:
  LightResiduals(const std::vector<SheetSample>& samples, double albedo)
      : samples_(samples), albedo_(albedo) {}

  [[nodiscard]] const std::vector<SheetSample>& Samples() const { return samples_; }

  // Residuals of (1) of the samples of these indices, three a sample.
  [[nodiscard]] std::vector<double> Of(const Light& light,
                                       const std::vector<size_t>& indices) const;

  /// The robust spread of how neighbours differ in how they lie off a model, in units of sd_rgb:
  /// noise, whatever the model lacks.
  [[nodiscard]] double NoiseRms(const Light& light, const std::vector<size_t>& indices) const;

  /// Levenberg and Marquardt's method from `start`, on the rung `model`.
  ///
  /// loss_scale  of Cauchy's loss, in units of sd_rgb; 0: squares
  /// Errors      kDegenerate: no usable solution; a covariance that the samples do not determine
  [[nodiscard]] Result<LightDescent> Descend(LightModel model, const Light& start,
                                             const std::vector<size_t>& indices, double loss_scale,
                                             bool with_covariance = false) const;

 private:
  const std::vector<SheetSample>& samples_;
  double albedo_;
};

}  // namespace sateen
