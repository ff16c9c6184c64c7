#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct FieldFitOptions {
  double albedo = 0.99;          // albedo of the paper, (0, 1]
  double spacing_mm = 20.0;      // distance of knots, > 0: rings narrower than twice this remain
  double gain_sd = 0.2;          // prior standard deviation of the mean gain about 1; > 0
  double position_sd_mm = 20.0;  // standard deviation of the ruler's position per axis; > 0
  int most_iterations = 12;      // steps of each descent, 1 or more

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// LED with its gain field.
struct FieldFit {
  Light light;                  // on the rung kLedField
  double roughness_weight = 0;  // lambda of (2), chosen by the held-out samples
  std::vector<size_t> used;     // indices of the samples that follow the light
  int iterations = 0;
  // Covariance of position and log flux, 6 x 6, for residuals of variance 1. The uncertainty of the
  // field is included.
  Eigen::MatrixXd covariance = {};
};

/// Fits the top rung: position, flux and gain field of an LED together,
///
///     r_jc = (rho phi_c E(x_j; s) g(x'_j) - i_jc) / sd_jc,  x' = ShadowOnTable(s, x)         (1)
///     argmin sum w_jc r_jc^2 + v (lambda sum |second differences of gain|^2
///                                 + sum (gain - 1)^2 / (M gain_sd^2)
///                                 + |s - s_ruler|^2 / position_sd^2)                        (2)
///
/// where E is the irradiance that an LED of flux 1 gives the sheet, M the number of gains and v the
/// variance of the noise, from differences between neighbours. Axis and fall-off are given; the
/// field makes up for their errors. By Gauss and Newton's method. w are first Cauchy's weights,
/// closing in, then 1 within 4 robust standard deviations and 0 beyond. lambda is the largest power
/// of ten of a row that explains `held_out` within 1 % of the best. At the end the mean of g over
/// the samples is 1: the factor that g and phi share goes to phi.
///
/// One flat sheet cannot tell a light that is elsewhere from a gain that varies: every s explains
/// it with some g. Then the last terms of (2) decide, and the light stays where the ruler put it,
/// with the ruler's error. Sheets tilted to several sides can tell: the same ray, and so the same
/// gain, meets them at another distance and angle.
///
/// ruler    on the rung kLed: s_ruler, axis and fall-off, and a flux that is about right
/// indices  samples to fit
/// held_out  samples that choose lambda, not among `indices`; if empty, lambda is
///           `roughness_weight`
/// Errors   kInvalidArgument: an option out of range; a light that is no LED
///          kDegenerate: fewer than half of the samples follow one light; no solution
/// Cost     about 2 us per sample and iteration
[[nodiscard]] Result<FieldFit> FitField(const std::vector<SheetSample>& samples, const Light& ruler,
                                        const std::vector<size_t>& indices,
                                        const std::vector<size_t>& held_out,
                                        double roughness_weight = 100.0,
                                        const FieldFitOptions& options = {});

}  // namespace sateen
