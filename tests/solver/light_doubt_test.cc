#include "solver/light_doubt.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "core/angle.h"
#include "rig/projection.h"
#include "simulation/random.h"
#include "simulation/rigs.h"
#include "tests/solver/ladder_cases.h"

namespace sateen::light_doubt_test {
namespace {

using testing::DistantRig;
using testing::Render;
using testing::RippleOf;

constexpr ImageSize kSmall{24, 18};

// Three standard normal deviates for a light of a rig.
Eigen::Vector3d Deviates(uint64_t rig, size_t light) {
  return {NormalDeviate(rig, 7 * light), NormalDeviate(rig, 7 * light + 1),
          NormalDeviate(rig, 7 * light + 2)};
}

// The same light off by what its standard deviations say.
Light Disturbed(const Light& light, uint64_t rig, size_t k) {
  Light off = light;
  const Eigen::Vector3d deviates = Deviates(rig, k);
  if (light.model == LightModel::kDistant) {
    const double sd = *light.direction_sd_deg * kRadPerDeg / std::sqrt(2.0);
    const Eigen::Vector3d across = light.direction.unitOrthogonal();
    off.direction = (light.direction +
                     sd * (deviates[0] * across + deviates[1] * light.direction.cross(across)))
                        .normalized();
  } else {
    off.position_mm += light.position_sd_mm->cwiseProduct(deviates);
    // As a fit has it, what the table gets is known better than the distance.
    off.flux_rgb *= off.position_mm.squaredNorm() / light.position_mm.squaredNorm();
  }
  off.flux_rgb *= 1.0 + *light.irradiance_sd * NormalDeviate(rig, 7 * k + 3);
  return off;
}

struct ActualOverPredicted {
  double angle = 0.0;
  double albedo = 0.0;
};

// Root mean squares over 2,000 disturbed rigs, of some pixels: error over what LightDoubt says. 1 =
// honest.
ActualOverPredicted CompareDisturbed(const Rig& rig, const RenderedRelief& truth) {
  const LightDoubt doubt = LightDoubt::Make(rig, kSmall).value();
  double angle = 0.0;
  double albedo = 0.0;
  int count = 0;
  for (uint64_t draw = 0; draw < 2000; ++draw) {
    Rig off = rig;
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      off.lights[k] = Disturbed(rig.lights[k], draw, k);
    }
    NormalField field = SolveLambertian(truth.stack, off, std::nullopt).value();
    field.uncertainty = field.albedo_uncertainty = Image<float>(kSmall);
    for (int row = 0; row < kSmall.height; ++row) {
      doubt.AddToRow(row, field.reason.Index(0, row), field);
    }
    Image<float> error;
    EXPECT_TRUE(AngularErrorDeg(field, truth.normal, &error));
    const Image<float> of_albedo = AlbedoErrorMap(field, truth.albedo).value();
    for (size_t p = 5; p < error.pixels.size(); p += 31) {
      angle += std::pow(static_cast<double>(error.pixels[p] / field.uncertainty.pixels[p]), 2.0);
      albedo += std::pow(
          static_cast<double>(of_albedo.pixels[p] / field.albedo_uncertainty.pixels[p]), 2.0);
      ++count;
    }
  }
  return {std::sqrt(angle / count), std::sqrt(albedo / count)};
}

void ExpectHonest(const Rig& rig, double within) {
  for (const double slope_deg : {1.0, 30.0}) {
    const ActualOverPredicted ratio = CompareDisturbed(rig, Render(rig, kSmall, slope_deg));
    EXPECT_NEAR(ratio.angle, 1.0, within) << slope_deg;
    EXPECT_NEAR(ratio.albedo, 1.0, within) << slope_deg;
  }
}

TEST(LightDoubt, IsTheActualErrorUnderDirectionsOrFluxesThatAreOff) {
  const auto rig_of = [](double direction_sd_deg, double irradiance_sd) {
    Rig rig = DistantRig(DistantRing(8, 40.0 * kRadPerDeg));
    for (Light& light : rig.lights) {
      light.direction_sd_deg = direction_sd_deg;
      light.irradiance_sd = irradiance_sd;
    }
    return rig;
  };
  ExpectHonest(rig_of(0.5, 0.001), 0.03);
  ExpectHonest(rig_of(0.01, 0.02), 0.03);
}

TEST(LightDoubt, IsTheActualErrorUnderPositionsThatAreOff) {
  Rig rig = RingRig(kSmall, LightModel::kNear);
  for (Light& light : rig.lights) {
    light.position_sd_mm = {2.0, 2.0, 2.0};
    light.irradiance_sd = 0.001;
  }
  // The effect of a shift on the irradiance away from the table's middle is not in (2).
  ExpectHonest(rig, 0.13);
}

// Two near lights are off, and each tile has what its own middle suffers.
TEST(LightDoubt, EveryTileHasItsOwn) {
  const ImageSize size{200, 130};
  Rig rig = RingRig(size, LightModel::kNear);
  rig.lights[0].irradiance_sd = 0.05;
  rig.lights[3].position_sd_mm = {3.0, 0.0, 1.0};
  const LightDoubt doubt = LightDoubt::Make(rig, size).value();
  NormalField field;
  field.Resize(size);
  field.uncertainty = field.albedo_uncertainty = Image<float>(size);
  for (size_t p = 0; p < size.PixelCount(); ++p) {
    field.normal[2].pixels[p] = 1.0F;
    field.reason.pixels[p] = static_cast<uint8_t>(Reason::kSolved);
  }
  for (int row = 0; row < size.height; ++row) {
    doubt.AddToRow(row, field.reason.Index(0, row), field);
  }
  // Column and row of a pixel, and the middle of its tile.
  for (const auto& [x, y, middle_x, middle_y] :
       {std::array{10, 10, 32, 32}, {150, 10, 160, 32}, {199, 70, 199, 96}, {63, 129, 32, 129}}) {
    const Eigen::Vector3d place = TablePointOfPixel(*rig.camera, middle_x, middle_y).value();
    Eigen::MatrixX3d l(static_cast<Eigen::Index>(rig.lights.size()), 3);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      l.row(static_cast<Eigen::Index>(k)) = IncidentAt(rig.lights[k], place).l;
    }
    const Eigen::Matrix3Xd g = (l.transpose() * l).inverse() * l.transpose();
    const double c0 = l(0, 2);
    const double c3 = l(3, 2);
    const double d3 = (rig.lights[3].position_mm - place).norm();
    const double across = (10.0 - std::pow(3.0 * l(3, 0), 2) - std::pow(l(3, 2), 2)) / 2.0;
    const double squared = g.col(0).head<2>().squaredNorm() * 0.05 * 0.05 * c0 * c0 +
                           g.col(3).head<2>().squaredNorm() * across / (d3 * d3) * (1.0 - c3 * c3);
    EXPECT_NEAR(static_cast<double>(field.uncertainty.At(x, y)), std::sqrt(squared) * kDegPerRad,
                1e-4)
        << x << ", " << y;
    const double along = g(2, 0) * g(2, 0) * 0.05 * 0.05 * c0 * c0 +
                         g(2, 3) * g(2, 3) * across / (d3 * d3) * (1.0 - c3 * c3);
    EXPECT_NEAR(static_cast<double>(field.albedo_uncertainty.At(x, y)), std::sqrt(along), 1e-6)
        << x << ", " << y;
  }
}

TEST(LightDoubt, ARigThatSaysNothingHasNone) {
  EXPECT_FALSE(LightDoubt::Make(DistantRig(DistantRing(8, 40.0 * kRadPerDeg)), kSmall));
}

TEST(LightDoubt, GoesIntoTheUncertaintyOfTheLadder) {
  Rig rig = testing::TwoRings();
  const RenderedRelief rendered = RippleOf({.full_scale = 2.0}, rig, kSmall);
  const NormalField sure = SolveLadder(rendered.stack, rig, std::nullopt).value();
  for (Light& light : rig.lights) {
    light.direction_sd_deg = 1.0;
  }
  const NormalField unsure = SolveLadder(rendered.stack, rig, std::nullopt).value();
  NormalField expected = sure;
  const LightDoubt doubt = LightDoubt::Make(rig, kSmall).value();
  doubt.AddToRow(12, sure.reason.Index(0, 12), expected);
  for (int x = 0; x < kSmall.width; ++x) {
    if (sure.model.At(x, 12) == static_cast<uint8_t>(Rung::kLeastSquares)) {
      EXPECT_FLOAT_EQ(unsure.uncertainty.At(x, 12), expected.uncertainty.At(x, 12));
      EXPECT_FLOAT_EQ(unsure.albedo_uncertainty.At(x, 12), expected.albedo_uncertainty.At(x, 12));
      EXPECT_GT(unsure.uncertainty.At(x, 12), 0.2F);
    }
  }
  EXPECT_GT(unsure.summary.least_squares.mean_uncertainty_deg, 0.2);
  EXPECT_EQ(unsure.normal[0].pixels, sure.normal[0].pixels);
}

}  // namespace
}  // namespace sateen::light_doubt_test
