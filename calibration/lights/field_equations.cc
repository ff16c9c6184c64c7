#include "calibration/lights/field_equations.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace sateen {
namespace {

constexpr double kFieldReferenceMm2 = 1e6;  // square of the distance at which flux is irradiance
constexpr size_t kKnots = 16;               // that a gain depends on

// Adds lambda v (g_0 - 2 g_1 + g_2)^2 of three knots in a row.
void AddSecondDifference(const GainField& field, size_t middle, size_t stride, double weight,
                         FieldNormal& normal) {
  const std::array<size_t, 3> knots = {middle - stride, middle, middle + stride};
  const std::array<double, 3> difference = {1.0, -2.0, 1.0};
  double value = 0.0;
  for (size_t i = 0; i < 3; ++i) {
    value += difference[i] * field.gain[knots[i]];
  }
  for (size_t i = 0; i < 3; ++i) {
    const auto at_i = kFieldGainAt + static_cast<Eigen::Index>(knots[i]);
    normal.gradient[at_i] -= weight * difference[i] * value;
    for (size_t j = 0; j < 3; ++j) {
      const auto at_j = kFieldGainAt + static_cast<Eigen::Index>(knots[j]);
      normal.information(at_i, at_j) += weight * difference[i] * difference[j];
    }
  }
  normal.cost += weight * value * value;
}

// Adds (x - mean)^2 times a precision.
void AddScalarPrior(Eigen::Index unknown, double from_mean, double precision, FieldNormal& normal) {
  normal.information(unknown, unknown) += precision;
  normal.gradient[unknown] -= precision * from_mean;
  normal.cost += precision * from_mean * from_mean;
}

}  // namespace

SheetShading ShadingOf(const SheetSample& sample, const Light& led) {
  const Eigen::Vector3d d = led.position_mm - sample.point_mm;
  const double distance = d.norm();
  const double facing = sample.normal.dot(d);
  const double along = led.axis.dot(d);  // < 0 in front of the LED
  if (!(facing > 0.0 && along < 0.0)) {
    return {};
  }
  SheetShading shading;
  shading.value = kFieldReferenceMm2 * facing / (distance * distance * distance) *
                  std::pow(-along / distance, led.anisotropy);
  // Derivative of the logarithm: facing, cube of the distance, cosine to the axis.
  shading.by_position =
      shading.value * (sample.normal / facing + led.anisotropy * led.axis / along -
                       (3.0 + led.anisotropy) * d / (distance * distance));
  return shading;
}

TableShadow ShadowOf(const SheetSample& sample, const Light& led) {
  const Eigen::Vector3d& s = led.position_mm;
  const Eigen::Vector3d& x = sample.point_mm;
  TableShadow shadow{.at_mm = ShadowOnTable(s, x)};
  const double fall_mm = s.z() - x.z();
  shadow.by_position.leftCols<2>() = Eigen::Matrix2d::Identity() * (1.0 - s.z() / fall_mm);
  shadow.by_position.col(2) = (s - x).head<2>() * (x.z() / (fall_mm * fall_mm));
  return shadow;
}

Eigen::Index GainUnknown(const GainField& field, const GainField::Weights& weights, size_t i) {
  const auto columns = static_cast<size_t>(field.columns);
  return kFieldGainAt + static_cast<Eigen::Index>(weights.first + (i / 4) * columns + i % 4);
}

FieldPrediction PredictWithField(const SheetSample& sample, const Light& light, double albedo) {
  const SheetShading shading = ShadingOf(sample, light);
  const TableShadow shadow = ShadowOf(sample, light);
  FieldPrediction at{.g = 0.0, .knots = light.field.WeightsAt(shadow.at_mm)};
  at.a = albedo * shading.value * light.flux_rgb.array() / sample.sd_rgb.array();
  Eigen::RowVector2d slope = Eigen::RowVector2d::Zero();
  for (size_t i = 0; i < kKnots; ++i) {
    const double gain =
        light.field.gain[static_cast<size_t>(GainUnknown(light.field, at.knots, i) - kFieldGainAt)];
    at.g += gain * at.knots.value[i];
    slope += gain * Eigen::RowVector2d(at.knots.along_x[i], at.knots.along_y[i]);
  }
  at.q = (slope * shadow.by_position).transpose();
  if (shading.value > 0.0) {
    at.q += at.g * shading.by_position / shading.value;
  }
  return at;
}

void AddFieldSamples(const std::vector<SheetSample>& samples, const Light& light, double albedo,
                     const std::vector<size_t>& indices, const std::vector<double>& residuals,
                     const std::vector<double>& weights, FieldNormal& normal) {
  constexpr size_t kShared = 3 + kKnots;  // unknowns but for log flux, which differs by channel
  for (size_t i = 0; i < indices.size(); ++i) {
    const FieldPrediction at = PredictWithField(samples[indices[i]], light, albedo);
    Eigen::Matrix<double, kShared, 1> row;
    std::array<Eigen::Index, kShared> place;
    for (size_t s = 0; s < 3; ++s) {
      row[static_cast<Eigen::Index>(s)] = at.q[static_cast<Eigen::Index>(s)];
      place[s] = static_cast<Eigen::Index>(s);
    }
    for (size_t k = 0; k < kKnots; ++k) {
      row[static_cast<Eigen::Index>(3 + k)] = at.knots.value[k];
      place[3 + k] = GainUnknown(light.field, at.knots, k);
    }
    const Eigen::Array3d r(residuals[3 * i], residuals[3 * i + 1], residuals[3 * i + 2]);
    const Eigen::Array3d aa = weights[i] * at.a.square();
    const Eigen::Array3d ar = weights[i] * at.a * r;
    normal.cost += weights[i] * r.square().sum();
    for (size_t m = 0; m < kShared; ++m) {
      const Eigen::Index to = place[m];
      const double of_m = row[static_cast<Eigen::Index>(m)];
      normal.gradient[to] -= ar.sum() * of_m;
      const double scaled = aa.sum() * of_m;
      for (size_t n = 0; n < kShared; ++n) {
        normal.information(place[n], to) += scaled * row[static_cast<Eigen::Index>(n)];
      }
      for (Eigen::Index c = 0; c < 3; ++c) {
        normal.information(kFieldFluxAt + c, to) += aa[c] * at.g * of_m;
        normal.information(to, kFieldFluxAt + c) += aa[c] * at.g * of_m;
      }
    }
    for (Eigen::Index c = 0; c < 3; ++c) {
      normal.information(kFieldFluxAt + c, kFieldFluxAt + c) += aa[c] * at.g * at.g;
      normal.gradient[kFieldFluxAt + c] -= ar[c] * at.g;
    }
  }
}

void AddFieldPriors(const Light& light, const FieldPriors& priors, double roughness,
                    double variance, FieldNormal& normal) {
  const GainField& field = light.field;
  const auto columns = static_cast<size_t>(field.columns);
  const auto rows = static_cast<size_t>(field.rows);
  const double of_gain =
      variance / (priors.gain_sd * priors.gain_sd * static_cast<double>(field.gain.size()));
  for (size_t knot = 0; knot < field.gain.size(); ++knot) {
    const size_t column = knot % columns;
    const size_t row = knot / columns;
    if (column > 0 && column + 1 < columns) {
      AddSecondDifference(field, knot, 1, variance * roughness, normal);
    }
    if (row > 0 && row + 1 < rows) {
      AddSecondDifference(field, knot, columns, variance * roughness, normal);
    }
    AddScalarPrior(kFieldGainAt + static_cast<Eigen::Index>(knot), field.gain[knot] - 1.0, of_gain,
                   normal);
  }
  const double of_position = variance / (priors.position_sd_mm * priors.position_sd_mm);
  for (Eigen::Index i = 0; i < 3; ++i) {
    AddScalarPrior(i, light.position_mm[i] - priors.position_mm[i], of_position, normal);
  }
}

}  // namespace sateen
