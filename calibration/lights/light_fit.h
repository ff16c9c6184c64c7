#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct LightFitOptions {
  double albedo = 0.99;  // of the paper, (0, 1]
  // Above which no rung is tried. kDistant is never: a sheet cannot tell it from a far near light.
  LightModel highest_rung = LightModel::kLedField;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// One rung of the model ladder, fitted.
struct RungFit {
  Light light;
  double residual_rms = 0.0;  // of the samples that were used, in units of SheetSample::sd_rgb
  double held_out_rms = 0.0;  // of every fifth sample, after a fit without them, likewise
  int iterations = 0;
  double roughness_weight = 0.0;  // of the field, as the held-out samples chose it (field_fit.h)
};

struct LightFit {
  Light light;                 // of the rung that was chosen
  std::vector<RungFit> rungs;  // as far as they were tried
  double noise_rms = 0.0;      // of the samples, from neighbours: what no model can explain
  size_t used = 0;  // samples; the others lie off the model: dust, folds, the paper's edge
  size_t left_out = 0;
  // Standard deviations: of the position along the table's axes, of the light's direction where it
  // is worst among the samples, of the flux, relative.
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  double direction_sd_rad = 0.0;
  Eigen::Vector3d flux_sd = Eigen::Vector3d::Zero();
};

/// One light from sheets of white paper in known poses: position and flux, on the rung of an LED its
/// axis and fall-off, and above that a gain field (field_fit.h),
///
///     argmin sum_j sum_c ((i_jc - rho e_c(x_j) max(0, n_j . l(x_j))) / sd_jc)^2            (1)
///
/// with l and e of rig/light.h, by Levenberg and Marquardt's method (Ceres) from `rough`. First
/// with Cauchy's loss, closing in; then samples further than 4 robust standard deviations from the model are left
/// out, and the rest is fitted again. Each rung is fitted without every fifth sample, and the lowest one
/// whose error on those is within 10 % of the noise, or else the best, is fitted to all.
/// The noise is measured, from how neighbouring samples differ, so `sd_rgb` matters up to a factor.
///
/// samples  in rows of neighbours, at least 50; sheets one after the other
/// rough    kNear or kLed, within some 50 mm
/// Errors   kInvalidArgument: an option out of range; a rough light that is distant
///          kDegenerate: too few samples; all dark; no fit that holds for half of them
/// Cost     about 10 us a sample
[[nodiscard]] Result<LightFit> FitLight(const std::vector<SheetSample>& samples, const Light& rough,
                                        const LightFitOptions& options = {});

}  // namespace sateen
