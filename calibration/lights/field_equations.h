#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/gauss_newton.h"
#include "rig/light.h"

// Normal equations of an LED with a gain field: equations (1) and (2) of field_fit.h. Unknowns are
// the position, log flux per channel, and the gains of all knots.
namespace sateen {

inline constexpr Eigen::Index kFieldFluxAt = 3;
inline constexpr Eigen::Index kFieldGainAt = 6;

using FieldNormal = NormalEquations<Eigen::Dynamic>;

// E of (1) and its derivatives by the light's position.
struct SheetShading {
  double value = 0.0;
  Eigen::Vector3d by_position = Eigen::Vector3d::Zero();
};
[[nodiscard]] SheetShading ShadingOf(const SheetSample& sample, const Light& led);

// x' of (1) and its derivatives by the light's position.
struct TableShadow {
  Eigen::Vector2d at_mm = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> by_position = Eigen::Matrix<double, 2, 3>::Zero();
};
[[nodiscard]] TableShadow ShadowOf(const SheetSample& sample, const Light& led);

// Prediction a_c g of one sample in channel c, in units of its noise, and its derivatives: a_c q by
// the position, a_c g by the channel's log flux, a_c times the weights of `knots` by the gains.
struct FieldPrediction {
  Eigen::Array3d a = Eigen::Array3d::Zero();
  Eigen::Vector3d q = Eigen::Vector3d::Zero();
  double g = 1.0;
  GainField::Weights knots = {};
};
[[nodiscard]] FieldPrediction PredictWithField(const SheetSample& sample, const Light& light,
                                               double albedo);

// Returns the unknown that is the gain of knot i of the 16 of `weights`.
[[nodiscard]] Eigen::Index GainUnknown(const GainField& field, const GainField::Weights& weights,
                                       size_t i);

/// Adds (1) of the samples of these indices.
///
/// residuals  predicted less measured, three per index
/// weights    one per index
void AddFieldSamples(const std::vector<SheetSample>& samples, const Light& light, double albedo,
                     const std::vector<size_t>& indices, const std::vector<double>& residuals,
                     const std::vector<double>& weights, FieldNormal& normal);

// Prior knowledge in (2).
struct FieldPriors {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // s_ruler
  double position_sd_mm = 0.0;
  double gain_sd = 0.0;
};

/// Adds the last three terms of (2) at this light: roughness lambda and variance v.
void AddFieldPriors(const Light& light, const FieldPriors& priors, double roughness,
                    double variance, FieldNormal& normal);

}  // namespace sateen
