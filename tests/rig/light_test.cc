#include "rig/light.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sateen::light_test {
namespace {

using ::testing::HasSubstr;

// Tolerances of 1e-12 are rounding.
constexpr double kRounding = 1e-12;

Light LedAbove(double height_mm, double anisotropy) {
  Light light;
  light.model = LightModel::kLed;
  light.position_mm = {0, 0, height_mm};
  light.anisotropy = anisotropy;
  light.flux_rgb = {1, 2, 3};
  return light;
}

TEST(IncidentAt, DistantLightIsTheSameEverywhere) {
  Light light;
  light.direction = {0.6, 0, 0.8};
  light.flux_rgb = {1, 2, 3};
  for (const Eigen::Vector3d& x_mm : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(70, -90, 5)}) {
    const Incident incident = IncidentAt(light, x_mm);
    EXPECT_EQ(incident.l, light.direction);
    EXPECT_EQ(incident.e_rgb, light.flux_rgb);
  }
}

TEST(IncidentAt, NearLightFallsWithTheSquareOfTheDistance) {
  Light light;
  light.model = LightModel::kNear;
  light.position_mm = {300, 0, 400};
  light.flux_rgb = {1, 2, 3};

  const Incident at_origin = IncidentAt(light, {0, 0, 0});  // at 500 mm: 4 times that at 1 m
  EXPECT_TRUE(at_origin.l.isApprox(Eigen::Vector3d(0.6, 0, 0.8), kRounding));
  EXPECT_TRUE(at_origin.e_rgb.isApprox(Eigen::Vector3d(4, 8, 12), kRounding));

  const Incident below = IncidentAt(light, {300, 0, 0});  // at 400 mm: 6.25 times
  EXPECT_TRUE(below.l.isApprox(Eigen::Vector3d::UnitZ(), kRounding));
  EXPECT_TRUE(below.e_rgb.isApprox(Eigen::Vector3d(6.25, 12.5, 18.75), kRounding));
}

TEST(IncidentAt, LedFallsWithThePowerOfTheCosineToItsAxis) {
  const Light light = LedAbove(1000, 2.0);
  EXPECT_TRUE(IncidentAt(light, {0, 0, 0}).e_rgb.isApprox(light.flux_rgb, kRounding));
  // At 1 m to the side the distance is sqrt(2) m and the cosine sqrt(1/2): 1/2 of 1/2.
  const Incident aside = IncidentAt(light, {1000, 0, 0});
  EXPECT_TRUE(aside.e_rgb.isApprox(light.flux_rgb / 4, kRounding));
  EXPECT_TRUE(aside.l.isApprox(Eigen::Vector3d(-1, 0, 1) / std::sqrt(2.0), kRounding));
}

TEST(IncidentAt, LedShinesAlongItsAxis) {
  Light light = LedAbove(1000, 1.0);
  light.axis = Eigen::Vector3d(1, 0, -1) / std::sqrt(2.0);  // towards +x
  EXPECT_GT(IncidentAt(light, {500, 0, 0}).e_rgb.x(), IncidentAt(light, {-500, 0, 0}).e_rgb.x());
  EXPECT_TRUE(IncidentAt(light, {1000, 0, 0}).e_rgb.isApprox(light.flux_rgb / 2, kRounding));
}

TEST(IncidentAt, LedIsDarkBehind) {
  Light light = LedAbove(1000, 1.0);
  light.axis = Eigen::Vector3d::UnitZ();
  EXPECT_EQ(IncidentAt(light, {0, 0, 0}).e_rgb, Eigen::Vector3d::Zero());
}

TEST(IncidentAt, LedWithoutAnisotropyIsANearLight) {
  Light led = LedAbove(400, 0.0);
  Light near = led;
  near.model = LightModel::kNear;
  EXPECT_EQ(IncidentAt(led, {120, 50, 0}).e_rgb, IncidentAt(near, {120, 50, 0}).e_rgb);
}

TEST(LightModel, NamesAreThoseOfTheFile) {
  EXPECT_EQ(Name(LightModel::kDistant), "distant");
  EXPECT_EQ(Name(LightModel::kNear), "near");
  EXPECT_EQ(Name(LightModel::kLed), "led");
  EXPECT_EQ(Name(LightModel::kLedField), "led+field");
}

TEST(Light, ValidateNamesTheFieldOutOfRange) {
  const auto message = [](LightModel model, auto change) {
    Light light = LedAbove(400, 1.0);
    light.model = model;
    EXPECT_TRUE(light.Validate("light"));
    change(light);
    const Status status = light.Validate("lights.txt: light 3");
    EXPECT_TRUE(!status && status.error().code == ErrorCode::kBadData);
    return status ? "" : status.error().message;
  };
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(message(LightModel::kDistant,
                    [](Light& l) {
                      l.direction = {0, 0, 2};
                    }),
            "lights.txt: light 3: direction [0, 0, 2] has length 2; need a unit vector");
  EXPECT_THAT(message(LightModel::kNear, [](Light& l) { l.position_mm.z() = 0; }),
              HasSubstr("position_mm [0, 0, 0]; need finite numbers and z > 0"));
  EXPECT_THAT(message(LightModel::kNear, [&](Light& l) { l.position_mm.x() = infinity; }),
              HasSubstr("position_mm"));
  EXPECT_THAT(message(LightModel::kLed,
                      [](Light& l) {
                        l.axis = {0, 0, 0};
                      }),
              HasSubstr("axis [0, 0, 0] has length 0; need a unit vector"));
  EXPECT_THAT(message(LightModel::kLed, [](Light& l) { l.anisotropy = -1; }),
              HasSubstr("anisotropy -1; need 0 to 50"));
  EXPECT_THAT(message(LightModel::kDistant, [](Light& l) { l.flux_rgb.y() = 0; }),
              HasSubstr("intensity [1, 0, 3]; need three finite numbers > 0"));
  EXPECT_THAT(message(LightModel::kNear, [](Light& l) { l.position_sd_mm.emplace(1, -1, 1); }),
              HasSubstr("position_sd_mm [1, -1, 1]; need three finite numbers >= 0"));
  EXPECT_THAT(message(LightModel::kDistant, [](Light& l) { l.direction_sd_deg = 91; }),
              HasSubstr("direction_sd_deg 91; need 0 to 90"));
  EXPECT_THAT(message(LightModel::kDistant, [&](Light& l) { l.irradiance_sd = infinity; }),
              HasSubstr("irradiance_sd inf; need 0 to 1"));
}

TEST(Light, ValidateLooksAtTheFieldsOfTheModelOnly) {
  Light light = LedAbove(400, 1.0);
  light.direction = {0, 0, 7};
  EXPECT_TRUE(light.Validate("light"));
  light.model = LightModel::kDistant;
  light.direction = {0, 0, 1};
  light.position_mm = {0, 0, -5};
  light.axis = {0, 0, 7};
  EXPECT_TRUE(light.Validate("light"));
}

TEST(Light, ValidateAcceptsDirectionsRoundedToFourDigits) {
  Light light;
  light.direction = {0.5774, 0.5774, 0.5774};  // length 1.00009
  EXPECT_TRUE(light.Validate("light"));
}

}  // namespace
}  // namespace sateen::light_test
