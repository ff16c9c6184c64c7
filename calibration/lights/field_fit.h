#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct FieldFitOptions {
  double albedo = 0.99;      // of the paper, (0, 1]
  double spacing_mm = 20.0;  // between knots, > 0: rings and spots narrower than twice this stay
  double gain_sd = 0.2;      // of the whole field from 1, beforehand; > 0
  double position_sd_mm = 20.0;  // of the position that the ruler gave, along each axis; > 0
  int most_iterations = 12;      // of each descent, 1 or more

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

struct FieldFit {
  Light light;                  // of the rung kLedField
  double roughness_weight = 0;  // lambda of (2), as the held-out samples chose it
  std::vector<size_t> used;     // of the indices: those that follow the light
  int iterations = 0;
  // Of position and log flux, 6 x 6, for residuals of variance 1; the field has its share in it.
  Eigen::MatrixXd covariance = {};
};

/// The top rung: an LED's position, flux and gain field together,
///
///     r_jc = (rho phi_c E(x_j; s) g(x'_j) - i_jc) / sd_jc,  x' = ShadowOnTable(s, x)            (1)
///     argmin sum w_jc r_jc^2 + v (lambda sum |second differences of gain|^2
///                                 + sum (gain - 1)^2 / (M gain_sd^2)
///                                 + |s - s_ruler|^2 / position_sd^2)                            (2)
///
/// where E is what an LED of flux 1 gives a surface of the sheet's normal, M the number of gains and v
/// the noise's variance, from how neighbours differ. Axis and fall-off stay as they are given: the field takes what is wrong with
/// them. Gauss and Newton's method, the gains being linear in (1); w are Cauchy's weights, closing in,
/// then 1 within 4 robust standard deviations and 0 beyond. lambda is the largest of a row of powers of
/// ten that explains `held_out` within 1 % of the best. At the end g is 1 in the mean over the samples:
/// what g and phi share goes to phi.
///
/// One flat sheet cannot tell a light that stands elsewhere from a gain that varies: every s explains it
/// with some g. Then the last terms of (2) decide, and the light stays where the ruler had it, with the
/// ruler's error. Sheets tilted to several sides can tell: the same ray, and so the same gain, meets them
/// at another distance and another angle.
///
/// ruler    of the rung kLed: s_ruler, axis and fall-off, and a flux that is about right
/// indices  of the samples to fit; held_out of those to judge by, not among them, or empty: lambda as
///          given by `roughness_weight`
/// Errors   kInvalidArgument: an option out of range; a light that is no LED
///          kDegenerate: fewer than half of the samples follow one light; no solution
/// Cost     about 2 us a sample and iteration; derivatives by hand, tested against numeric ones
[[nodiscard]] Result<FieldFit> FitField(const std::vector<SheetSample>& samples, const Light& ruler,
                                        const std::vector<size_t>& indices,
                                        const std::vector<size_t>& held_out,
                                        double roughness_weight = 100.0,
                                        const FieldFitOptions& options = {});

// E of (1), and its derivatives by the light's position.
struct SheetShading {
  double value = 0.0;
  Eigen::Vector3d by_position = Eigen::Vector3d::Zero();
};
[[nodiscard]] SheetShading ShadingOf(const SheetSample& sample, const Light& led);

// x' of (1), and its derivatives by the light's position, 2 x 3.
struct TableShadow {
  Eigen::Vector2d at_mm = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> by_position = Eigen::Matrix<double, 2, 3>::Zero();
};
[[nodiscard]] TableShadow ShadowOf(const SheetSample& sample, const Light& led);

}  // namespace sateen
