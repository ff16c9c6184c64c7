#include "solver/least_squares/gain_rows.h"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cmath>

#include "rig/projection.h"
#include "tests/solver/solver_cases.h"

namespace sateen::gain_rows_test {
namespace {

// Every pixel against the spline itself, at sizes and lenses where 16 px between knots do and do
// not.
TEST(GainRows, EveryPixelIsWithinTheBound) {
  for (const int width : {61, 640, 1900}) {
    const ImageSize size{width, width * 2 / 3};
    Rig rig = RingRig(size, LightModel::kLedField, 300.0);
    rig.camera->distortion = {-0.12, 0.03, 0.001, -0.0005, 0.0};
    rig.lights[2].model = LightModel::kLed;
    const GainRows gains = GainRows::Make(*rig.camera, rig.lights).value();
    EXPECT_FALSE(gains.Has(2));
    double worst = 0.0;
    std::vector<float> row(static_cast<size_t>(width));
    for (const size_t k : {size_t{0}, size_t{3}}) {
      ASSERT_TRUE(gains.Has(k));
      for (int v = 0; v < size.height; v += 7) {
        gains.Row(k, v, row);
        for (int u = 0; u < width; ++u) {
          const Eigen::Vector3d point = TablePointOfPixel(*rig.camera, u, v).value();
          const double exact = 1.0 / rig.lights[k].field.At(point.head<2>());
          worst = std::max(
              worst, std::abs(static_cast<double>(row[static_cast<size_t>(u)]) / exact - 1.0));
        }
      }
    }
    fmt::print("{} px wide: gain within {:.1e}\n", width, worst);
    EXPECT_LT(worst, 3e-6);  // 2e-6 in the middles of the cells
  }
}

TEST(GainRows, AnImageSmallerThanTheGridIsExact) {
  for (const ImageSize size :
       {ImageSize{1, 1}, ImageSize{2, 5}, ImageSize{5, 3}, ImageSize{3, 2}}) {
    const Rig rig = RingRig(size, LightModel::kLedField);
    const GainRows gains = GainRows::Make(*rig.camera, rig.lights).value();
    std::vector<float> row(static_cast<size_t>(size.width));
    for (int v = 0; v < size.height; ++v) {
      gains.Row(1, v, row);
      for (int u = 0; u < size.width; ++u) {
        const Eigen::Vector3d point = TablePointOfPixel(*rig.camera, u, v).value();
        EXPECT_NEAR(static_cast<double>(row[static_cast<size_t>(u)]),
                    1.0 / rig.lights[1].field.At(point.head<2>()), 1e-6)
            << size.width << " " << u << " " << v;
      }
    }
  }
}

// Lights with and without a field side by side, each backend against the truth.
TEST(SolveLambertian, AFieldIsDividedOut) {
  const ImageSize size{203, 64};  // no whole number of vectors
  Rig rig = RingRig(size, LightModel::kLedField, 300.0);
  rig.lights[1].model = LightModel::kNear;
  rig.lights[4].model = LightModel::kLed;
  const RenderedRelief rendered = testing::Render(rig, size);
  for (const Backend backend : testing::kAllBackends) {
    const NormalField field =
        SolveLambertian(rendered.stack, rig, std::nullopt, {.backend = backend}).value();
    EXPECT_EQ(field.summary.solved, field.summary.pixels);
    const ErrorStatistics angle = AngularErrorDeg(field, rendered.normal).value();
    fmt::print("{}: mean {:.1e}, worst {:.1e} degrees\n", Name(backend), angle.mean, angle.max);
    EXPECT_LT(angle.max, 3e-4) << Name(backend);  // gains within 3e-6 for the fast ones
    EXPECT_LT(RelativeAlbedoError(field, rendered.albedo).value().max, 1e-5);
  }
  // The field is not a trifle.
  Rig without = rig;
  for (Light& light : without.lights) {
    light.model = light.model == LightModel::kLedField ? LightModel::kLed : light.model;
  }
  const NormalField wrong =
      SolveLambertian(rendered.stack, without, std::nullopt, {.backend = Backend::kFast}).value();
  EXPECT_GT(AngularErrorDeg(wrong, rendered.normal).value().max, 0.3);
}

}  // namespace
}  // namespace sateen::gain_rows_test
