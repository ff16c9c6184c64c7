#include "solver/lambertian.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "imaging/color.h"
#include "tests/solver/solver_cases.h"

namespace sateen::lambertian_test {
namespace {

using namespace sateen::testing;  // NOLINT(google-build-using-namespace): the cases of this file
using ::testing::HasSubstr;

class EveryBackend : public ::testing::TestWithParam<Backend> {
 protected:
  [[nodiscard]] LambertianOptions Options() const { return {.backend = GetParam()}; }
};

INSTANTIATE_TEST_SUITE_P(Backends, EveryBackend, ::testing::ValuesIn(kAllBackends),
                         [](const auto& param) {
                           std::string name(Name(param.param));
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

void ExpectExact(const NormalField& field, const RenderedRelief& truth) {
  EXPECT_EQ(field.summary.solved, field.summary.pixels);
  const ErrorStatistics angle = AngularErrorDeg(field, truth.normal).value();
  const ErrorStatistics albedo = RelativeAlbedoError(field, truth.albedo).value();
  // The bar for noiseless scenes; rounding alone costs about a tenth of it.
  EXPECT_LT(angle.mean, 1e-4);
  EXPECT_LT(angle.max, 1e-3);
  EXPECT_LT(albedo.max, 1e-5);
}

TEST_P(EveryBackend, RecoversNoiselessReliefUnderDistantLights) {
  const Rig rig = RingRig({97, 61}, LightModel::kDistant);
  const RenderedRelief relief = Render(rig, {97, 61});

  ExpectExact(SolveLambertian(relief.stack, rig, std::nullopt, Options()).value(), relief);
}

TEST_P(EveryBackend, RecoversNoiselessReliefUnderNearLights) {
  const Rig rig = RingRig({97, 61}, LightModel::kNear);
  const RenderedRelief relief = Render(rig, {97, 61});

  ExpectExact(SolveLambertian(relief.stack, rig, std::nullopt, Options()).value(), relief);
}

TEST_P(EveryBackend, RecoversNoiselessReliefUnderColouredLedsOfAnyAnisotropy) {
  Rig rig = RingRig({97, 61}, LightModel::kLed);
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    rig.lights[k].anisotropy = 0.3 * static_cast<double>(k);
    rig.lights[k].flux_rgb = Eigen::Vector3d(0.9, 0.7 + 0.02 * static_cast<double>(k), 0.5);
  }
  const RenderedRelief relief = Render(rig, {97, 61});

  ExpectExact(SolveLambertian(relief.stack, rig, std::nullopt, Options()).value(), relief);
}

TEST_P(EveryBackend, RecoversReliefThroughATiltedDistortedCamera) {
  Rig rig = RingRig({97, 61}, LightModel::kNear);
  rig.camera->distortion = {-0.25, 0.08, 1e-3, -5e-4, 0.0};
  rig.camera->table_from_camera = Eigen::AngleAxisd(10.0 * kRadPerDeg, Eigen::Vector3d::UnitX()) *
                                  rig.camera->table_from_camera;
  const RenderedRelief relief = Render(rig, {97, 61});

  ExpectExact(SolveLambertian(relief.stack, rig, std::nullopt, Options()).value(), relief);
}

TEST_P(EveryBackend, MixesDistantAndNearLights) {
  Rig rig = RingRig({33, 17}, LightModel::kNear);
  const Lights distant = DistantRing(10, 30.0 * kRadPerDeg);
  std::copy_n(distant.begin(), 5, rig.lights.begin());
  const RenderedRelief relief = Render(rig, {33, 17});

  ExpectExact(SolveLambertian(relief.stack, rig, std::nullopt, Options()).value(), relief);
}

TEST_P(EveryBackend, AlbedoIsTheLengthOfEachChannelAndTheNormalComesFromLuminance) {
  // Channels that disagree about the normal: red is lit as if tilted, green and blue are level.
  const Rig rig = DistantRig(DistantRing(8, 40.0 * kRadPerDeg));
  const Eigen::Vector3d n_red = Eigen::Vector3d(0.2, -0.1, 1.0).normalized() * 0.5;
  const Eigen::Vector3d n_green = Eigen::Vector3d::UnitZ() * 0.25;
  LightStack stack;
  for (const Light& light : rig.lights) {
    LightFrame frame{.rgb = Image3(ImageSize{1, 1})};
    frame.rgb[0].pixels[0] = static_cast<float>(n_red.dot(light.direction));
    frame.rgb[1].pixels[0] = static_cast<float>(n_green.dot(light.direction));
    frame.rgb[2].pixels[0] = frame.rgb[1].pixels[0];
    stack.push_back(frame);
  }
  const double w = static_cast<double>(kLuminance[0]);
  const Eigen::Vector3d n = (w * n_red + (1.0 - w) * n_green).normalized();

  const NormalField field = SolveLambertian(stack, rig, std::nullopt, Options()).value();

  EXPECT_NEAR(field.albedo[0].pixels[0], 0.5, 1e-6);
  EXPECT_NEAR(field.albedo[1].pixels[0], 0.25, 1e-6);
  EXPECT_NEAR(field.normal[0].pixels[0], n.x(), 1e-6);
  EXPECT_NEAR(field.normal[1].pixels[0], n.y(), 1e-6);
  EXPECT_NEAR(field.normal[2].pixels[0], n.z(), 1e-6);
}

TEST_P(EveryBackend, ResidualIsTheRootMeanSquareOfTheMisfit) {
  // i' = N . l + 0.05 cos(2 azimuth): orthogonal to x, y, z and 1 over a ring of eight, so the
  // solution does not move and the residual is 0.05 / sqrt(2) exactly.
  const Rig rig = DistantRig(DistantRing(8, 40.0 * kRadPerDeg));
  LightStack stack;
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    LightFrame frame{.rgb = Image3(ImageSize{1, 1})};
    const double misfit = 0.05 * std::cos(std::numbers::pi * static_cast<double>(k) / 2.0);
    SetSample(frame, 0, static_cast<float>(0.5 * rig.lights[k].direction.z() + misfit));
    stack.push_back(frame);
  }

  const NormalField field = SolveLambertian(stack, rig, std::nullopt, Options()).value();

  EXPECT_NEAR(field.residual.pixels[0], 0.05 / std::numbers::sqrt2, 1e-7);
  EXPECT_NEAR(field.normal[2].pixels[0], 1.0, 1e-6);
}

TEST_P(EveryBackend, LeavesPixelsOutsideTheMaskZero) {
  const Rig rig = RingRig({33, 17});
  const RenderedRelief relief = Render(rig, {33, 17});
  Mask mask(ImageSize{33, 17}, 1);
  mask.pixels[40] = 0;

  const NormalField field = SolveLambertian(relief.stack, rig, mask, Options()).value();

  EXPECT_EQ(ReasonAt(field, 40), Reason::kOutsideMask);
  EXPECT_EQ(field.normal[2].pixels[40], 0.0F);
  EXPECT_EQ(field.albedo[0].pixels[40], 0.0F);
  EXPECT_EQ(field.samples.pixels[40], 0);
  EXPECT_EQ(field.summary.pixels, 33 * 17 - 1);
  EXPECT_EQ(ReasonAt(field, 41), Reason::kSolved);
  EXPECT_EQ(field.samples.pixels[41], 10);
}

TEST_P(EveryBackend, AnEarlierResultInTheSameMemoryLeavesNoTrace) {
  const Rig rig = RingRig({33, 17});
  const RenderedRelief relief = Render(rig, {33, 17});
  LightStack dark = relief.stack;
  ScaleRadiance(dark, 0.0F);
  NormalField field = SolveLambertian(relief.stack, rig, std::nullopt, Options()).value();

  ASSERT_TRUE(SolveLambertianInto(dark, rig, std::nullopt, Options(), {}, field));

  EXPECT_TRUE(SameBits(field, SolveLambertian(dark, rig, std::nullopt, Options()).value()));
  EXPECT_EQ(field.summary.dark, 33 * 17);
}

TEST_P(EveryBackend, PixelsBelowTheDarkLevelAreDarkHoweverManySamplesTheyHave) {
  const Rig rig = RingRig({33, 17});
  RenderedRelief relief = Render(rig, {33, 17});
  for (LightFrame& frame : relief.stack) {
    frame.full_scale = 100.0F;  // the brightest sample is below 1
  }
  LambertianOptions options = Options();
  options.dark_level = 0.01;

  const NormalField field = SolveLambertian(relief.stack, rig, std::nullopt, options).value();

  EXPECT_EQ(field.summary.dark, 33 * 17);
  EXPECT_EQ(field.normal[2].pixels[0], 0.0F);
  EXPECT_EQ(field.albedo[1].pixels[0], 0.0F);
}

TEST_P(EveryBackend, AnLedLightsNothingBehindIt) {
  Rig rig = RingRig({33, 17}, LightModel::kLed);
  for (Light& light : rig.lights) {
    light.anisotropy = 0.0;  // even where it shines evenly before it
  }
  RenderedRelief relief = Render(rig, {33, 17}, 10.0);
  rig.lights[2].axis = -rig.lights[2].axis;  // said to be turned round: its samples are no use

  const NormalField field = SolveLambertian(relief.stack, rig, std::nullopt, Options()).value();

  EXPECT_EQ(field.samples.pixels[100], 9);
  EXPECT_LT(AngularErrorDeg(field, relief.normal).value().max, 1e-3);
}

TEST_P(EveryBackend, FluxInAnyUnitMeetsRadianceInAnyUnit) {
  for (const double flux : {1e-30, 1e-9, 1e6, 1e9, 1e34}) {
    SCOPED_TRACE(flux);
    Rig rig = RingRig({33, 17});
    RenderedRelief relief = Render(rig, {33, 17});
    for (Light& light : rig.lights) {
      light.flux_rgb *= flux;
    }
    const float radiance = flux > 1.0 ? 1e-11F : 1e11F;  // the other way
    ScaleRadiance(relief.stack, radiance);

    const NormalField field = SolveLambertian(relief.stack, rig, std::nullopt, Options()).value();

    EXPECT_EQ(field.summary.solved, 33 * 17);
    EXPECT_EQ(field.summary.resolved_by_reference, 0);
    EXPECT_LT(AngularErrorDeg(field, relief.normal).value().max, 1e-3);
    const double expected =
        static_cast<double>(relief.albedo[1].pixels[7]) / flux * static_cast<double>(radiance);
    if (expected > 1e-37 && expected < 1e37) {  // range of a float
      EXPECT_NEAR(static_cast<double>(field.albedo[1].pixels[7]) / expected, 1.0, 1e-5);
    }
  }
}

// Cancels as soon as the solve reports a first step.
class CancelAtFirstStep : public Progress {
 public:
  void BeginStage(std::string_view /*name*/, int /*total*/) override {}
  void Clear() override {}
  void Advance(int /*steps*/) override { cancel = true; }

  std::atomic<bool> cancel = false;
};

TEST_P(EveryBackend, StopsInTheMiddleWhenCancelled) {
  const Rig rig = RingRig({64, 512});
  const RenderedRelief relief = Render(rig, {64, 512});
  CancelAtFirstStep progress;

  const Result<NormalField> field =
      SolveLambertian(relief.stack, rig, std::nullopt, Options(),
                      {.progress = &progress, .cancel = &progress.cancel});

  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().code, ErrorCode::kCancelled);
}

TEST_P(EveryBackend, StopsWhenCancelled) {
  const Rig rig = RingRig({33, 17});
  const RenderedRelief relief = Render(rig, {33, 17});
  const std::atomic<bool> cancel = true;

  const Result<NormalField> field =
      SolveLambertian(relief.stack, rig, std::nullopt, Options(), {.cancel = &cancel});

  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().code, ErrorCode::kCancelled);
}

// ---- Errors -------------------------------------------------------------------------------------

struct BadInput {
  RenderedRelief relief = Render(RingRig({8, 6}), {8, 6});
  Rig rig = RingRig({8, 6});
  std::optional<Mask> mask;
};

Error ErrorOf(const BadInput& input, const LambertianOptions& options = {}) {
  const Result<NormalField> field =
      SolveLambertian(input.relief.stack, input.rig, input.mask, options);
  return field ? Error{ErrorCode::kInvalidArgument, "no error"} : field.error();
}

TEST(SolveLambertian, RefusesOneLightTooFew) {
  BadInput input;
  input.rig.lights.pop_back();

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("10 frames but 9 lights"));
  EXPECT_EQ(ErrorOf(input).code, ErrorCode::kBadData);
}

TEST(SolveLambertian, RefusesTwoLights) {
  BadInput input;
  input.rig.lights.resize(2);
  input.relief.stack.resize(2);

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("2 lights; need at least 3"));
  EXPECT_EQ(ErrorOf(input).code, ErrorCode::kDegenerate);
}

TEST(SolveLambertian, RefusesFramesOfTwoSizesAndNamesTheFrame) {
  BadInput input;
  input.relief.stack[3].rgb = Image3(ImageSize{8, 5});

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("led-3: 8x5 px, but led-0 is 8x6 px"));
}

TEST(SolveLambertian, RefusesAMaskOfAnotherSize) {
  BadInput input;
  input.mask = Mask(ImageSize{4, 4}, 1);

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("the mask is 4x4 px but the frames are 8x6 px"));
}

TEST(SolveLambertian, RefusesALightOfZeroIntensity) {
  BadInput input;
  input.rig.lights[4].flux_rgb.y() = 0.0;

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("intensity [0.36, 0, 0.36]"));
}

TEST(SolveLambertian, RefusesACameraOfAnotherSize) {
  BadInput input;
  input.rig.camera->size_px = {9, 6};

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("camera has 9x6 px but the frames are 8x6 px"));
}

TEST(SolveLambertian, RefusesNearLightsWithoutACamera) {
  BadInput input;
  input.rig.camera.reset();

  EXPECT_THAT(ErrorOf(input).message, HasSubstr("camera is missing, but lights[0] is"));
}

TEST(LambertianOptions, NamesTheFieldOutOfRange) {
  const auto message = [](const LambertianOptions& options) {
    return options.Validate().error().message;
  };
  EXPECT_THAT(message({.shadow_level = 1.0}), HasSubstr("shadow_level = 1; need"));
  EXPECT_THAT(message({.clip_level = 0.0}), HasSubstr("clip_level = 0; need"));
  EXPECT_THAT(message({.dark_level = -1.0}), HasSubstr("dark_level = -1; need"));
  EXPECT_THAT(message({.max_condition = 1.0}), HasSubstr("max_condition = 1; need"));
  EXPECT_TRUE(LambertianOptions{}.Validate());
}

TEST(Backend, NamesGoBothWays) {
  for (const Backend backend : kAllBackends) {
    EXPECT_EQ(BackendNamed(Name(backend)), backend);
  }
  EXPECT_EQ(BackendNamed("svd"), std::nullopt);
}

}  // namespace
}  // namespace sateen::lambertian_test
