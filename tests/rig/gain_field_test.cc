#include "rig/gain_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "rig/light.h"

namespace sateen::gain_field_test {
namespace {

using ::testing::HasSubstr;

// Tolerances of 1e-12 are rounding.
constexpr double kRounding = 1e-12;

// Coefficients from a function of the knots' places.
GainField FieldOf(const std::function<double(double, double)>& coefficient) {
  GainField field{.origin_mm = {-70.0, 20.0}, .spacing_mm = 12.5, .columns = 7, .rows = 6};
  for (int r = 0; r < field.rows; ++r) {
    for (int c = 0; c < field.columns; ++c) {
      field.gain.push_back(coefficient(field.origin_mm.x() + c * field.spacing_mm,
                                       field.origin_mm.y() + r * field.spacing_mm));
    }
  }
  return field;
}

// The rectangle in which equation (1) holds: x -57.5 to -7.5, y 32.5 to 70.
const std::vector<Eigen::Vector2d> kInside = {{-57.5, 32.5}, {-7.5, 70.0}, {-45.0, 45.0},
                                              {-31.4, 51.7}, {-8.0, 33.0}, {-56.9, 69.9}};

TEST(GainField, WeightsAddUpToOne) {
  const GainField field = FieldOf([](double, double) { return 1.0; });
  for (const Eigen::Vector2d& x : kInside) {
    const GainField::Weights weights = field.WeightsAt(x);
    EXPECT_NEAR(std::accumulate(weights.value.begin(), weights.value.end(), 0.0), 1.0, kRounding);
    EXPECT_NEAR(std::accumulate(weights.along_x.begin(), weights.along_x.end(), 0.0), 0.0,
                kRounding);
    EXPECT_NEAR(std::accumulate(weights.along_y.begin(), weights.along_y.end(), 0.0), 0.0,
                kRounding);
    EXPECT_NEAR(field.At(x), 1.0, kRounding);
  }
}

// A cubic spline holds polynomials to the third degree; its coefficients for x^2 and x^3 are those
// of their blossoms: x^2 - h^2 / 3 and x^3 - x h^2 at the knots.
TEST(GainField, IsExactOnPolynomials) {
  constexpr double kH = 12.5;
  const GainField linear = FieldOf([](double x, double y) { return 2.0 + 0.3 * x - 0.2 * y; });
  const GainField cubic = FieldOf([](double x, double y) {
    return (x * x * x - x * kH * kH) + 5.0 * (x * x - kH * kH / 3.0) * y -
           (y * y * y - y * kH * kH);
  });
  for (const Eigen::Vector2d& at : kInside) {
    const double x = at.x();
    const double y = at.y();
    EXPECT_NEAR(linear.At(at), 2.0 + 0.3 * x - 0.2 * y, 1e-11);
    EXPECT_NEAR(cubic.At(at), x * x * x + 5.0 * x * x * y - y * y * y, 1e-7);
  }
}

// The B-spline itself, at and between its knots.
TEST(GainField, OneCoefficientIsOneBSpline) {
  GainField field = FieldOf([](double, double) { return 0.0; });
  field.gain[2 * 7 + 3] = 36.0;  // knot at x = -32.5, y = 45
  const double h = field.spacing_mm;
  EXPECT_NEAR(field.At({-32.5, 45.0}), 36.0 * (2.0 / 3.0) * (2.0 / 3.0), kRounding);
  EXPECT_NEAR(field.At({-32.5 + h, 45.0}), 36.0 * (1.0 / 6.0) * (2.0 / 3.0), kRounding);
  EXPECT_NEAR(field.At({-32.5, 45.0 + h}), 36.0 * (2.0 / 3.0) * (1.0 / 6.0), kRounding);
  EXPECT_NEAR(field.At({-32.5 - 1.5 * h, 45.0}), 36.0 * (1.0 / 48.0) * (2.0 / 3.0), kRounding);
  EXPECT_NEAR(field.At({-32.5, 45.0 + 2.0 * h}), 0.0, kRounding);
}

GainField Rippled() {
  return FieldOf(
      [](double x, double y) { return 1.0 + 0.1 * std::sin(0.1 * x) * std::cos(0.07 * y); });
}

TEST(GainField, DerivativesAreThoseOfTheGain) {
  const GainField field = Rippled();
  constexpr double kStep = 1e-4;
  for (const Eigen::Vector2d& at :
       {Eigen::Vector2d(-45.1, 45.2), Eigen::Vector2d(-31.4, 51.7), Eigen::Vector2d(-9.0, 69.0)}) {
    const GainField::Weights weights = field.WeightsAt(at);
    double value = 0.0;
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < 16; ++i) {
      const double gain = field.gain[weights.first + (i / 4) * 7 + i % 4];
      value += gain * weights.value[i];
      slope += gain * Eigen::Vector2d(weights.along_x[i], weights.along_y[i]);
    }
    EXPECT_NEAR(value, field.At(at), kRounding);
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
      EXPECT_NEAR(slope[axis], (field.At(at + step) - field.At(at - step)) / (2.0 * kStep), 1e-9);
    }
  }
}

TEST(GainField, BeyondTheBorderIsAsAtTheBorder) {
  const GainField field = Rippled();
  EXPECT_EQ(field.At({-500.0, 45.0}), field.At({-57.5, 45.0}));
  EXPECT_EQ(field.At({500.0, 500.0}), field.At({-7.5, 70.0}));
  EXPECT_EQ(field.WeightsAt({-500.0, 45.0}).along_x[1], 0.0);
  EXPECT_NE(field.WeightsAt({-500.0, 45.0}).along_y[0], 0.0);
}

// A fit that diverged asks at such places: there is a gain, and no crash.
TEST(GainField, AnyPlaceHasAGain) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  GainField field{.origin_mm = {0.0, 0.0}, .spacing_mm = 10.0, .columns = 5, .rows = 4};
  field.gain.assign(20, 2.0);
  for (const double x : {0.0, nan, infinity, -infinity, 1e300, -1e300}) {
    for (const double y : {0.0, nan, infinity, -infinity, 1e300, -1e300}) {
      const double gain = field.At({x, y});
      EXPECT_TRUE(std::isnan(x) || std::isnan(y) ? std::isnan(gain) : std::abs(gain - 2.0) < 1e-12)
          << x << " " << y << " " << gain;
      EXPECT_LE(field.WeightsAt({x, y}).first, 1U);
    }
  }
}

TEST(ShadowOnTable, IsOnTheRayFromTheLight) {
  const Eigen::Vector3d light(100, -50, 400);
  EXPECT_EQ(ShadowOnTable(light, {30, 20, 0}), Eigen::Vector2d(30, 20));  // exact on the plane
  // A quarter of the way down from the light to (0, 0, 0).
  EXPECT_TRUE(ShadowOnTable(light, {75, -37.5, 300}).isZero(1e-9));
  // Below the table, as a tilted sheet's edge is.
  EXPECT_TRUE(ShadowOnTable(light, {-10, 5, -40}).isZero(1e-9));
  const Eigen::Vector2d level = ShadowOnTable(light, {101, -50, 400});
  EXPECT_GT(level.x(), 1000.0);
  EXPECT_NEAR(level.y(), -50.0, 1e-9);
}

TEST(IncidentAt, AFieldMultipliesTheLedAlongTheRay) {
  Light led;
  led.model = LightModel::kLed;
  led.position_mm = {100, -50, 400};
  led.axis = -led.position_mm.normalized();
  led.anisotropy = 1.5;
  Light fielded = led;
  fielded.model = LightModel::kLedField;
  fielded.field = Rippled();

  const Eigen::Vector3d on_table(-31.4, 51.7, 0.0);
  const Eigen::Vector3d above = on_table + 0.2 * (led.position_mm - on_table);
  for (const Eigen::Vector3d& x : {on_table, above}) {
    EXPECT_TRUE(
        IncidentAt(fielded, x)
            .e_rgb.isApprox(IncidentAt(led, x).e_rgb * fielded.field.At({-31.4, 51.7}), kRounding));
    EXPECT_EQ(IncidentAt(fielded, x).l, IncidentAt(led, x).l);
  }
}

TEST(GainField, ValidateNamesTheFieldOutOfRange) {
  const auto message = [](auto change) {
    GainField field = Rippled();
    EXPECT_TRUE(field.Validate("field"));
    change(field);
    const Status status = field.Validate("rig.json: lights[3]: field");
    return status ? "" : status.error().message;
  };
  EXPECT_EQ(message([](GainField& f) { f.spacing_mm = 0.0; }),
            "rig.json: lights[3]: field: spacing_mm is 0; need a number > 0");
  EXPECT_THAT(message([](GainField& f) { f.columns = 3; }),
              HasSubstr("has 3 columns and 6 rows; need 4 to 256 of each"));
  EXPECT_THAT(message([](GainField& f) { f.gain.pop_back(); }),
              HasSubstr("has 41 gains; need 7 columns x 6 rows = 42"));
  EXPECT_THAT(message([](GainField& f) { f.gain[5] = -0.25; }),
              HasSubstr("a gain is -0.25; need above 0 and up to 100"));
  EXPECT_THAT(
      message([](GainField& f) { f.origin_mm.x() = std::numeric_limits<double>::infinity(); }),
      HasSubstr("origin_mm is [inf, 20]; need finite numbers"));
}

}  // namespace
}  // namespace sateen::gain_field_test
