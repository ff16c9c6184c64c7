#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct LightFitOptions {
  double albedo = 0.99;  // albedo of the paper, (0, 1]
  // Highest rung to try. kDistant is never tried: a sheet cannot tell it from a far near light.
  LightModel highest_rung = LightModel::kLedField;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Fit of one rung of the model ladder.
struct RungFit {
  Light light;
  double residual_rms = 0.0;  // of the samples used, in units of SheetSample::sd_rgb
  double held_out_rms = 0.0;  // of every fifth sample, by a fit without them, in the same units
  int iterations = 0;
  double roughness_weight = 0.0;  // lambda of field_fit.h, chosen by the held-out samples
};

// Light on the rung that was chosen, and how well it is known.
struct LightFit {
  Light light;
  std::vector<RungFit> rungs;  // rungs that were tried, in order
  double noise_rms = 0.0;      // noise of the samples, from neighbours: what no model can explain
  size_t used = 0;             // samples used
  size_t left_out = 0;         // samples that deviate: dust, folds, the paper's edge
  // Standard deviations: of the position along the table's axes, of the direction from the sample
  // where it is worst, and of the flux, relative.
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  double direction_sd_rad = 0.0;
  Eigen::Vector3d flux_sd = Eigen::Vector3d::Zero();
};

/// Fits one light to sheets of white paper in known poses: position and flux; for an LED also axis
/// and fall-off; above that a gain field (field_fit.h),
///
///     argmin sum_j sum_c ((i_jc - rho e_c(x_j) max(0, n_j . l(x_j))) / sd_jc)^2            (1)
///
/// with l and e of rig/light.h, by Levenberg and Marquardt's method (Ceres) from `rough`, robustly
/// (robust_fit.h). Each rung is fitted without every fifth sample. The lowest rung whose error on
/// those is within 10 % of the noise, or else the best, is fitted to all. The noise is measured
/// from differences between neighbours, so a common factor of all `sd_rgb` does not matter.
///
/// samples  at least 50, in rows of neighbours, one sheet after the other
/// rough    kNear or kLed, within some 50 mm
/// Errors   kInvalidArgument: an option out of range; a rough light that is distant
///          kDegenerate: too few samples; all dark; no fit that holds for half of them
/// Cost     about 10 us per sample
[[nodiscard]] Result<LightFit> FitLight(const std::vector<SheetSample>& samples, const Light& rough,
                                        const LightFitOptions& options = {});

}  // namespace sateen
