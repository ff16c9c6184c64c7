// Numerical stability on hard cases, each with a known answer and a bound with its reason. The law:
// the right answer within the bound, or the pixel marked with its reason.

#include <gtest/gtest.h>

#include <numeric>
#include <string>

#include "tests/solver/solver_cases.h"

namespace sateen::stability_test {
namespace {

using namespace sateen::testing;  // NOLINT(google-build-using-namespace): the cases of this file

// Float arithmetic rounds about ten operations per sample and the lights besides: measured, three
// times the error of the reference on noiseless data.
constexpr double kFloatFactor = 8.0;
// Error that this gives at the worst conditioning that kFast accepts: a tenth and a fifth of the
// bars for noiseless scenes, a hundredth of the error that a 14-bit sensor leaves.
constexpr double kFloatFloorMaxDeg = 1e-4;
constexpr double kFloatFloorMeanDeg = 2e-5;

struct Case {
  LightStack stack;
  Rig rig;
  Image3 normal;  // truth
};

Case MakeCase(const Rig& rig, ImageSize size, double max_slope_deg = 30.0) {
  RenderedRelief relief = Render(rig, size, max_slope_deg);
  return {std::move(relief.stack), rig, std::move(relief.normal)};
}

NormalField Solve(const Case& c, Backend backend, const LambertianOptions& options = {},
                  int threads = 1) {
  LambertianOptions with_backend = options;
  with_backend.backend = backend;
  return SolveLambertian(c.stack, c.rig, std::nullopt, with_backend, {.threads = threads}).value();
}

// Every backend: solved pixels within the bound. kAuto: all that the reference solved, and never
// more than twice its error (or the rounding of float results, where both are that good).
void ExpectLaw(const Case& c, double bound_deg, const LambertianOptions& options = {}) {
  // kFast must not refuse a case that float can hold.
  const bool fast_must_solve = bound_deg <= RoundingBoundDeg(3.0);
  const NormalField reference = Solve(c, Backend::kJacobiSvd, options);
  const ErrorStatistics reference_error = AngularErrorDeg(reference, c.normal).value();
  for (const Backend backend : kAllBackends) {
    SCOPED_TRACE(std::string(Name(backend)));
    const NormalField field = Solve(c, backend, options);
    const ErrorStatistics error = AngularErrorDeg(field, c.normal).value();
    const bool in_float = backend == Backend::kFast || backend == Backend::kAuto;
    EXPECT_LE(error.max, in_float ? kFloatFactor * bound_deg : bound_deg);
    if (backend != Backend::kFast || fast_must_solve) {
      EXPECT_EQ(field.summary.solved, reference.summary.solved);
      // Lengths of channels suffer as the direction does, in radians.
      EXPECT_LE(RelativeAlbedoError(field, reference.albedo).value().max,
                kFloatFactor * bound_deg * kRadPerDeg + 1e-6);
    }
    if (backend == Backend::kAuto) {
      EXPECT_EQ(field.reason.pixels, reference.reason.pixels);
      EXPECT_LE(error.max, std::max(2.0 * reference_error.max, kFloatFloorMaxDeg));
      EXPECT_LE(error.mean, std::max(2.0 * reference_error.mean, kFloatFloorMeanDeg));
    }
  }
}

int64_t SolvedByAuto(const Case& c, const LambertianOptions& options = {}) {
  return Solve(c, Backend::kAuto, options).summary.solved;
}

// ---- Conditioning ------------------------------------------------------------------------------

// A ring of ten flattened towards the plane y = 0 until its condition number is about 1 / squeeze.
Lights TowardsPlane(double squeeze) {
  Lights lights = DistantRing(10, 45.0 * kRadPerDeg);
  for (Light& light : lights) {
    light.direction.y() *= squeeze;
    light.direction.normalize();
  }
  return lights;
}

// A ring of ten drawn together towards the zenith: condition number about sqrt(2) / polar.
Lights TowardsLine(double polar_rad) { return DistantRing(10, polar_rad); }

TEST(Stability, LightsSqueezedTowardsAPlaneOrALine) {
  const LambertianOptions options{.shadow_level = 0.0, .max_condition = 1e6};
  for (double squeeze = 0.1; squeeze > 5e-6; squeeze /= 10.0) {
    for (const Lights& lights : {TowardsPlane(squeeze), TowardsLine(squeeze)}) {
      const double condition = ConditionOf(lights);
      SCOPED_TRACE("condition " + std::to_string(condition));
      // Slopes of 20 degrees keep every light above the horizon of every pixel.
      const Case c = MakeCase(DistantRig(lights), {64, 48}, 20.0);
      ExpectLaw(c, RoundingBoundDeg(condition), options);
      EXPECT_EQ(SolvedByAuto(c, options), 64 * 48);
    }
  }
}

TEST(Stability, LightsBeyondTheConditionLimitAreRefusedAsAWhole) {
  for (const double squeeze : {1e-4, 1e-5, 1e-6, 1e-7, 0.0}) {
    for (const Lights& lights : {TowardsPlane(squeeze), TowardsLine(squeeze)}) {
      const Case c = {Render(DistantRig(TowardsPlane(0.1)), {4, 4}).stack, DistantRig(lights), {}};
      const Result<NormalField> field = SolveLambertian(c.stack, c.rig, std::nullopt);
      ASSERT_FALSE(field) << "squeeze " << squeeze;
      EXPECT_EQ(field.error().code, ErrorCode::kDegenerate);
    }
  }
}

TEST(Stability, CoplanarForSomePixelsOnly) {
  // Near lights in the plane y = 0: exactly coplanar for pixels on it, nearly so beside it.
  const ImageSize size{64, 41};
  Rig rig = RingRig(size);
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    const double x_mm = -180.0 + 40.0 * static_cast<double>(k);
    rig.lights[k].position_mm = Eigen::Vector3d(x_mm, 0.0, k % 2 == 0 ? 200.0 : 500.0);
  }
  const Case c = MakeCase(rig, size, 20.0);

  const NormalField field = Solve(c, Backend::kAuto);

  const int middle = size.height / 2;  // the row on y = 0
  for (int column = 0; column < size.width; ++column) {
    EXPECT_EQ(ReasonAt(field, field.reason.Index(column, middle)), Reason::kIllConditioned);
    EXPECT_EQ(ReasonAt(field, field.reason.Index(column, 0)), Reason::kSolved);
  }
  // Pixels are solved up to a condition number of 1000.
  ExpectLaw(c, RoundingBoundDeg(1000.0));
}

TEST(Stability, ALightFiveMillimetresAboveTheSample) {
  const ImageSize size{65, 65};
  Rig rig = RingRig(size, LightModel::kNear, /*width_mm=*/65.0);
  rig.lights[0].position_mm = Eigen::Vector3d(0.0, 0.0, 5.0);
  const Case c = MakeCase(rig, size, 20.0);

  // The ring alone has condition number sqrt(2); an eleventh row cannot worsen it beyond
  // sqrt((K + 1) / K) of that. Positions rounded to float move l by up to 1e-5 mm / 5 mm: 1e-4 deg.
  ExpectLaw(c, RoundingBoundDeg(2.0) + 1e-4);
  EXPECT_EQ(SolvedByAuto(c), 65 * 65);
}

TEST(Stability, NormalsAt85Degrees) {
  // Facing all azimuths, 85 degrees from the zenith, under lights 80 degrees from it.
  const Lights lights = DistantRing(10, 80.0 * kRadPerDeg);
  Rig rig = DistantRig(lights);
  Case c{{}, rig, Image3(ImageSize{360, 1})};
  for (size_t k = 0; k < lights.size(); ++k) {
    c.stack.push_back({.rgb = Image3(ImageSize{360, 1})});
  }
  for (size_t p = 0; p < 360; ++p) {
    const double azimuth_rad = static_cast<double>(p) * kRadPerDeg;
    const Eigen::Vector3d n(std::sin(85.0 * kRadPerDeg) * std::cos(azimuth_rad),
                            std::sin(85.0 * kRadPerDeg) * std::sin(azimuth_rad),
                            std::cos(85.0 * kRadPerDeg));
    for (size_t axis = 0; axis < 3; ++axis) {
      c.normal[axis].pixels[p] = static_cast<float>(n[static_cast<Eigen::Index>(axis)]);
    }
    for (size_t k = 0; k < lights.size(); ++k) {
      SetSample(c.stack[k], p, static_cast<float>(std::max(0.0, 0.5 * n.dot(lights[k].direction))));
    }
  }

  // About five lights over half a circle are usable; measured condition numbers stay below 30.
  ExpectLaw(c, RoundingBoundDeg(30.0));
  EXPECT_EQ(SolvedByAuto(c), 360);
}

// ---- Too few samples ---------------------------------------------------------------------------

TEST(Stability, ThreeTwoOneAndNoUsableSamples) {
  const Rig rig = RingRig({16, 4}, LightModel::kDistant);
  Case c = MakeCase(rig, {16, 4});
  // Row r keeps 3 - r samples: lights 0, 3, 6, spread around the ring.
  for (size_t k = 0; k < 10; ++k) {
    for (size_t p = 0; p < 64; ++p) {
      const size_t kept = 3 - p / 16;
      if (k % 3 != 0 || k / 3 >= kept) {
        SetSample(c.stack[k], p, 0.0F);
      }
    }
  }

  for (const Backend backend : kAllBackends) {
    SCOPED_TRACE(std::string(Name(backend)));
    const NormalField field = Solve(c, backend);
    EXPECT_EQ(ReasonAt(field, 0), Reason::kSolved);
    EXPECT_EQ(field.samples.pixels[0], 3);
    EXPECT_EQ(ReasonAt(field, 16), Reason::kTooFewSamples);
    EXPECT_EQ(field.samples.pixels[16], 2);
    EXPECT_EQ(ReasonAt(field, 32), Reason::kTooFewSamples);
    EXPECT_EQ(ReasonAt(field, 48), Reason::kDark);
    EXPECT_EQ(field.normal[2].pixels[48], 0.0F);
  }
  // Three of ten lights 108 degrees apart at 45 degrees: condition number 1.7.
  ExpectLaw(c, RoundingBoundDeg(2.0));
}

TEST(Stability, SaturationInSevenAndInEightOfTenLights) {
  const Rig rig = RingRig({32, 2}, LightModel::kDistant);
  Case c = MakeCase(rig, {32, 2}, 10.0);
  for (LightFrame& frame : c.stack) {
    frame.full_scale = 2.0F;
  }
  // Row 0: lights 0, 3, 6 are left; row 1: lights 0 and 3.
  for (size_t k = 0; k < 10; ++k) {
    for (size_t p = 0; p < 64; ++p) {
      const bool kept = k == 0 || k == 3 || (k == 6 && p < 32);
      if (!kept) {
        SetSample(c.stack[k], p, 2.0F);
      }
    }
  }

  for (const Backend backend : kAllBackends) {
    SCOPED_TRACE(std::string(Name(backend)));
    const NormalField field = Solve(c, backend);
    EXPECT_EQ(ReasonAt(field, 0), Reason::kSolved);
    EXPECT_EQ(ReasonAt(field, 32), Reason::kSaturated);
    EXPECT_EQ(field.summary.saturated, 32);
  }
  ExpectLaw(c, RoundingBoundDeg(2.0));
}

TEST(Stability, NotANumberInfinityAndNegativesAreLeftOut) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const Rig rig = RingRig({32, 8});
  Case c = MakeCase(rig, {32, 8});
  const std::array<float, 6> bad = {kNan, kInf, -kInf, -0.5F, -1e30F, -0.0F};
  for (size_t p = 0; p < 256; ++p) {
    SetSample(c.stack[p % 10], p, bad[p % 6]);
    c.stack[(p + 3) % 10].rgb[p % 3].pixels[p] = bad[p % 3];  // one channel alone
  }

  // Eight of ten lights on a ring are left; the worst eight have condition number 2.3.
  ExpectLaw(c, RoundingBoundDeg(2.5));
  EXPECT_EQ(SolvedByAuto(c), 256);
  for (const Backend backend : kAllBackends) {
    EXPECT_EQ(Solve(c, backend).samples.pixels[7], 8) << Name(backend);
  }
}

// ---- Scale -------------------------------------------------------------------------------------

TEST(Stability, RadianceFrom1eMinus12To1e12) {
  const Rig rig = RingRig({32, 8});
  for (int exponent = -36; exponent <= 30; exponent += 6) {
    SCOPED_TRACE("radiance 1e" + std::to_string(exponent));
    Case c = MakeCase(rig, {32, 8});
    ScaleRadiance(c.stack, static_cast<float>(std::pow(10.0, exponent)));

    ExpectLaw(c, 2.0 * RoundingBoundDeg(std::numbers::sqrt2));  // samples are rounded twice
    EXPECT_EQ(SolvedByAuto(c), 256);
    EXPECT_EQ(Solve(c, Backend::kAuto).summary.resolved_by_reference, 0);
  }
}

TEST(Stability, AlbedoAndResidualKeepTheirScale) {
  const Rig rig = RingRig({32, 8}, LightModel::kDistant);
  Case c = MakeCase(rig, {32, 8});
  for (size_t p = 0; p < 256; ++p) {
    for (Image<float>& plane : c.stack[0].rgb.planes) {
      plane.pixels[p] *= 1.25F;  // a residual worth comparing
    }
  }
  const NormalField plain = Solve(c, Backend::kFast);
  for (const int exponent : {-130, -100, -60, -41, 41, 60, 90}) {
    Case scaled = c;
    ScaleRadiance(scaled.stack, static_cast<float>(std::exp2(exponent)));
    const NormalField field = Solve(scaled, Backend::kFast);
    for (size_t p = 0; p < 256; ++p) {
      // Below 2^-126 results are subnormal: steps of 2^-149.
      const double step = std::max(4.0 * kFloatUnit, std::exp2(-149.0 - exponent) * 4.0);
      EXPECT_NEAR(std::ldexp(static_cast<double>(field.albedo[1].pixels[p]), -exponent),
                  static_cast<double>(plain.albedo[1].pixels[p]), step)
          << "2^" << exponent;
      EXPECT_NEAR(std::ldexp(static_cast<double>(field.residual.pixels[p]), -exponent),
                  static_cast<double>(plain.residual.pixels[p]), 2.0 * step)
          << "2^" << exponent;
    }
  }
}

TEST(Stability, SubnormalRadiance) {
  const Rig rig = RingRig({32, 8});
  Case c = MakeCase(rig, {32, 8});
  ScaleRadiance(c.stack, 1e-40F);

  // A sample of 3e-41 has steps of 1.4e-45: each is off by up to half of 5e-5 of itself.
  const double unit = 0.5 * 1.4e-45 / 3e-41;
  ExpectLaw(c, RoundingBoundDeg(std::numbers::sqrt2) * unit / kFloatUnit);
  EXPECT_EQ(SolvedByAuto(c), 256);
  EXPECT_EQ(Solve(c, Backend::kAuto).summary.resolved_by_reference, 0);
}

TEST(Stability, SubnormalSamplesAmongOrdinaryOnesAreShadow) {
  const Rig rig = RingRig({32, 8});
  Case c = MakeCase(rig, {32, 8});
  for (size_t p = 0; p < 256; ++p) {
    SetSample(c.stack[p % 10], p, 1e-41F);
  }

  ExpectLaw(c, RoundingBoundDeg(2.0));
  EXPECT_EQ(Solve(c, Backend::kFast).samples.pixels[5], 9);
}

TEST(Stability, LightIntensitiesSpreadOverAMillion) {
  Rig rig = RingRig({32, 8});
  for (size_t k = 0; k < 10; ++k) {
    rig.lights[k].flux_rgb *= std::pow(10.0, 6.0 * static_cast<double>(k) / 9.0 - 3.0);
  }
  const Case c = MakeCase(rig, {32, 8});

  ExpectLaw(c, RoundingBoundDeg(std::numbers::sqrt2));
  EXPECT_EQ(SolvedByAuto(c), 256);
}

// ---- Order and threads -------------------------------------------------------------------------

TEST(Stability, OrderOfLightsIsIrrelevant) {
  const Rig rig = RingRig({32, 8});
  const Case c = MakeCase(rig, {32, 8});
  Case reversed = c;
  std::reverse(reversed.stack.begin(), reversed.stack.end());
  std::reverse(reversed.rig.lights.begin(), reversed.rig.lights.end());

  for (const Backend backend : kAllBackends) {
    const NormalField a = Solve(c, backend);
    const ErrorStatistics difference = AngularErrorDeg(Solve(reversed, backend), a.normal).value();
    // Sums of ten in another order: a few roundings apart.
    EXPECT_LT(difference.max, kFloatFactor * RoundingBoundDeg(1.5)) << Name(backend);
  }
}

TEST(Stability, NarrowLeds) {
  // Irradiance to the power of 50 of a cosine that float knows to 1e-7: 5e-6 of it.
  for (const double anisotropy : {1.0, 4.0, 20.0, 50.0}) {
    Rig rig = RingRig({32, 8}, LightModel::kLed);
    for (Light& light : rig.lights) {
      light.anisotropy = anisotropy;
    }
    const Case c = MakeCase(rig, {32, 8});
    const ErrorStatistics error = AngularErrorDeg(Solve(c, Backend::kAuto), c.normal).value();
    EXPECT_LT(error.mean, 1e-4) << anisotropy;  // the bars for noiseless scenes
    EXPECT_LT(error.max, 1e-3) << anisotropy;
    EXPECT_EQ(SolvedByAuto(c), 256);
  }
}

TEST(Stability, OneTwoAndSevenThreadsGiveTheSameBits) {
  const ImageSize size{501, 117};  // not a multiple of any vector or piece
  ReliefScene scene{.shape = ReliefShape::kRipple, .max_slope_rad = 1.2, .sensor = SensorModel{}};
  scene.sensor->full_scale = 0.5;
  const Rig rig = RingRig(size);
  const RenderedRelief one = RenderRelief(scene, rig, size, {.threads = 1}).value();
  const RenderedRelief seven = RenderRelief(scene, rig, size, {.threads = 7}).value();
  for (size_t k = 0; k < one.stack.size(); ++k) {
    EXPECT_EQ(one.stack[k].rgb[0].pixels, seven.stack[k].rgb[0].pixels);
  }

  const Case c{one.stack, rig, one.normal};
  for (const Backend backend : kAllBackends) {
    const NormalField reference = Solve(c, backend, {}, 1);
    EXPECT_TRUE(SameBits(reference, Solve(c, backend, {}, 2))) << Name(backend);
    EXPECT_TRUE(SameBits(reference, Solve(c, backend, {}, 7))) << Name(backend);
  }
}

}  // namespace
}  // namespace sateen::stability_test
