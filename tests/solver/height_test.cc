#include "solver/height.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/solver/height_cases.h"
#include "tests/solver/ladder_cases.h"
#include "tests/solver/mosaic_cases.h"

namespace sateen::height_test {
namespace {

using namespace sateen::testing;  // NOLINT(google-build-using-namespace): the cases of this file
using ::testing::HasSubstr;

constexpr ImageSize kDrapeSize = {140, 106};

double MeanErrorDeg(const NormalField& field, const DrapedScene& scene) {
  return AngularErrorDeg(field, scene.rendered.normal).value().mean;
}

double MaxErrorDeg(const NormalField& field, const DrapedScene& scene) {
  return AngularErrorDeg(field, scene.rendered.normal).value().max;
}

NormalField Solved(const DrapedScene& scene, const Rig& rig, Backend backend = Backend::kAuto,
                   const std::optional<Image<float>>& height_mm = std::nullopt) {
  return SolveLambertian(scene.rendered.stack, rig, std::nullopt, {.backend = backend}, {},
                         height_mm)
      .value();
}

// The true normals as the answer of a solve.
NormalField TrueField(const DrapedScene& scene) {
  NormalField field;
  field.Resize(scene.height_mm.Size());
  field.normal = scene.rendered.normal;
  std::ranges::fill(field.reason.pixels, static_cast<uint8_t>(Reason::kSolved));
  return field;
}

void Unsolve(size_t pixel, NormalField& field) {
  for (size_t c = 0; c < 3; ++c) {
    field.normal[c].pixels[pixel] = 0.0F;
  }
  field.reason.pixels[pixel] = static_cast<uint8_t>(Reason::kDark);
}

// Largest difference from the truth over the solved pixels. Heights whose mean is 0 are those of
// the same picture from a camera that is nearer by the true mean:
// c_z - z = (c_z - z') (c_z - mean) / c_z.
double WorstHeightErrorMm(const Image<float>& height_mm, const DrapedScene& scene,
                          const NormalField& field, const Camera& camera) {
  double mean = 0.0;
  double count = 0.0;
  for (size_t p = 0; p < height_mm.pixels.size(); ++p) {
    if (IsSolved(field, p)) {
      mean += static_cast<double>(scene.height_mm.pixels[p]);
      count += 1.0;
    }
  }
  mean /= count;
  const double nearness = 1.0 - mean / camera.table_from_camera.translation().z();
  double worst = 0.0;
  for (size_t p = 0; p < height_mm.pixels.size(); ++p) {
    if (IsSolved(field, p)) {
      worst = std::max(worst, std::abs(mean + nearness * static_cast<double>(height_mm.pixels[p]) -
                                       static_cast<double>(scene.height_mm.pixels[p])));
    }
  }
  return worst;
}

class EveryLight : public ::testing::TestWithParam<LightModel> {};
INSTANTIATE_TEST_SUITE_P(Lights, EveryLight,
                         ::testing::Values(LightModel::kNear, LightModel::kLed,
                                           LightModel::kLedField));

TEST_P(EveryLight, ALiftedRigSolvesAThickClothAsExactlyAsOneOnTheTable) {
  const Rig rig = CloseRig(kDrapeSize, GetParam());
  const DrapedScene flat = RenderDrape({.mean_mm = 5.0}, rig);
  const DrapedScene ribbed = RenderDrape({.mean_mm = 5.0, .ripple_mm = 0.3}, rig);
  const Rig lifted = Lifted(rig, 5.0).value();

  fmt::print("{}: mean {:.3f} degrees on the table, {:.1e} lifted\n", Name(GetParam()),
             MeanErrorDeg(Solved(flat, rig), flat), MeanErrorDeg(Solved(flat, lifted), flat));
  EXPECT_LT(MaxErrorDeg(Solved(flat, lifted), flat), 5e-5);     // as exact data on the table
  EXPECT_LT(MaxErrorDeg(Solved(ribbed, lifted), ribbed), 0.1);  // 0.3 mm of 280 mm are 0.06 degrees
  // Directions are off by 5 mm sin 45 of 280 mm, 0.7 degrees, which the lights share in part.
  EXPECT_GT(MeanErrorDeg(Solved(flat, rig), flat), 0.4);
  EXPECT_GT(MeanErrorDeg(Solved(flat, Lifted(rig, -5.0).value()), flat),
            1.8 * MeanErrorDeg(Solved(flat, rig), flat));  // the wrong way: twice as far off
}

TEST_P(EveryLight, HeightsOfEachPixelAreExactInEveryBackend) {
  const Rig rig = CloseRig(kDrapeSize, GetParam());
  const DrapedScene scene =
      RenderDrape({.mean_mm = 3.0, .amplitude_mm = 8.0, .ripple_mm = 0.3}, rig);
  Image<float> wrong_way = scene.height_mm;
  for (float& z : wrong_way.pixels) {
    z = -z;
  }

  for (const Backend backend : kAllBackends) {
    SCOPED_TRACE(Name(backend));
    EXPECT_LT(MaxErrorDeg(Solved(scene, rig, backend, scene.height_mm), scene), 5e-5);
  }
  EXPECT_GT(MeanErrorDeg(Solved(scene, rig), scene), 0.4);
  EXPECT_GT(MeanErrorDeg(Solved(scene, rig, Backend::kAuto, wrong_way), scene),
            1.5 * MeanErrorDeg(Solved(scene, rig), scene));
}

TEST_P(EveryLight, HeightsReachEveryRungAndTheMosaics) {
  const Rig rig = CloseRig(kDrapeSize, GetParam());
  DrapedScene scene = RenderDrape({.amplitude_mm = 8.0}, rig);

  const auto solve_rung = [&](LadderMode mode) {
    return SolveLadder(scene.rendered.stack, rig, std::nullopt, {.mode = mode}, {}, scene.height_mm)
        .value();
  };
  EXPECT_LT(MaxErrorDeg(solve_rung(LadderMode::kLeastSquares), scene), 1e-4);
  EXPECT_LT(MaxErrorDeg(solve_rung(LadderMode::kConsensus), scene), 1e-4);
  Readings readings(scene.rendered, rig);
  // Half a step of 16 bits at a third of full scale is 1.4e-3 degrees.
  for (const Backend backend : {Backend::kAuto, Backend::kJacobiSvd}) {
    const NormalField plain = readings.Solve(rig, Plain(backend), 0, std::nullopt, scene.height_mm);
    EXPECT_LT(MaxErrorDeg(plain, scene), 4e-3);
  }
  for (const LadderMode mode : {LadderMode::kAuto, LadderMode::kConsensus}) {
    const NormalField field = readings.Solve(rig, {.mode = mode}, 0, std::nullopt, scene.height_mm);
    EXPECT_LT(MaxErrorDeg(field, scene), mode == LadderMode::kAuto ? 4e-3 : 0.03);  // triples
  }
  EXPECT_GT(MeanErrorDeg(readings.Solve(rig), scene), 0.2);
}

TEST(Height, OfZeroChangesNoBit) {
  const Rig rig = CloseRig(kDrapeSize, LightModel::kLed);
  const DrapedScene scene = RenderDrape({.amplitude_mm = 3.0}, rig);
  const Image<float> zero(kDrapeSize);

  EXPECT_TRUE(SameBits(Solved(scene, rig), Solved(scene, rig, Backend::kAuto, zero)));
  EXPECT_TRUE(SameBits(Solved(scene, rig), Solved(scene, Lifted(rig, 0.0).value())));
}

TEST(IntegrateNormals, FindsADrapeThroughALeaningDistortedCamera) {
  // Sides that the transform takes, and an odd one and one of a large prime, for which it is
  // larger.
  for (const ImageSize size : {ImageSize{140, 108}, ImageSize{139, 106}}) {
    Rig rig = CloseRig(size);
    rig.camera->distortion = {-0.1, 0.02, 1e-3, -5e-4, 0.0};
    const DrapedScene scene = RenderDrape({.amplitude_mm = 8.0}, rig);
    const NormalField field = TrueField(scene);

    const Image<float> height = IntegrateNormals(field, *rig.camera).value();

    // (3) is the trapezium rule: at 1 mm per pixel off by (z''(b) - z''(a)) / 12 mm^2, 2e-3 mm.
    EXPECT_LT(WorstHeightErrorMm(height, scene, field, *rig.camera), 3e-3);
    double mean = 0.0;
    for (const float z : height.pixels) {
      mean += static_cast<double>(z) / static_cast<double>(height.pixels.size());
    }
    EXPECT_NEAR(mean, 0.0, 1e-5);
  }
}

TEST(IntegrateNormals, GoesAroundWhatIsNotSolvedAndSpansIt) {
  const Rig rig = CloseRig(kDrapeSize);
  const DrapedScene scene = RenderDrape({.amplitude_mm = 8.0}, rig);
  NormalField field = TrueField(scene);
  for (int y = 0; y < kDrapeSize.height; ++y) {
    for (int x = 0; x < kDrapeSize.width; ++x) {
      const bool is_hole = std::hypot(x - 60, y - 50) < 12.0;
      const bool is_outside = std::hypot(x - 70, y - 53) > 60.0;
      if (is_hole || is_outside || (7 * x + 3 * y) % 29 == 0) {
        Unsolve(scene.height_mm.Index(x, y), field);
      }
    }
  }

  const Image<float> height = IntegrateNormals(field, *rig.camera).value();

  EXPECT_LT(WorstHeightErrorMm(height, scene, field, *rig.camera), 3e-3);
  // A membrane over the hole of 24 mm: the cloth's bend over it, 12^2 / 4 of 8 (kX^2 + kY^2), is
  // 0.7 mm.
  const float middle = height.At(60, 50) - height.At(46, 50);
  EXPECT_NEAR(static_cast<double>(middle),
              static_cast<double>(scene.height_mm.At(60, 50) - scene.height_mm.At(46, 50)), 1.0);
}

TEST(IntegrateNormals, PlacesPartsThatNothingJoinsByTheFlattestMembrane) {
  const Rig rig = CloseRig(kDrapeSize);
  const DrapedScene flat = RenderDrape({}, rig);
  NormalField field = TrueField(flat);
  for (int y = 0; y < kDrapeSize.height; ++y) {
    for (int x = 60; x < 80; ++x) {
      Unsolve(flat.height_mm.Index(x, y), field);
    }
  }
  EXPECT_LT(
      WorstHeightErrorMm(IntegrateNormals(field, *rig.camera).value(), flat, field, *rig.camera),
      1e-3);
}

TEST(IntegrateNormals, GivesTheSameBitsOnAnyNumberOfThreads) {
  const Rig rig = CloseRig(kDrapeSize);
  const DrapedScene scene = RenderDrape({.amplitude_mm = 8.0, .ripple_mm = 0.3}, rig);
  NormalField field = TrueField(scene);
  Unsolve(scene.height_mm.Index(70, 50), field);

  EXPECT_EQ(IntegrateNormals(field, *rig.camera, {.threads = 1})->pixels,
            IntegrateNormals(field, *rig.camera, {.threads = 3})->pixels);
}

TEST(IntegrateNormals, RefusesWhatItCannotTellFrom) {
  const Rig rig = CloseRig(kDrapeSize);
  NormalField field = TrueField(RenderDrape({}, rig));
  Camera other = *rig.camera;
  other.size_px.width += 2;
  EXPECT_THAT(IntegrateNormals(field, other).error().message, HasSubstr("140x106 px"));
  Camera placeless = *rig.camera;
  placeless.has_pose = false;
  EXPECT_THAT(IntegrateNormals(field, placeless).error().message, HasSubstr("calibrate pose"));
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    Unsolve(p, field);
  }
  EXPECT_EQ(IntegrateNormals(field, *rig.camera).error().code, ErrorCode::kDegenerate);
}

// `sateen solve --relief` does this.
TEST_P(EveryLight, ASecondSolveAtTheHeightsOfTheFirstIsFarBetter) {
  const Rig rig = CloseRig(kDrapeSize, GetParam());
  const DrapedScene scene =
      RenderDrape({.mean_mm = 5.0, .amplitude_mm = 8.0, .ripple_mm = 0.3}, rig);
  double mean_mm = 0.0;
  for (const float z : scene.height_mm.pixels) {
    mean_mm += static_cast<double>(z) / static_cast<double>(kDrapeSize.PixelCount());
  }
  const Rig lifted = Lifted(rig, mean_mm).value();

  const NormalField first = Solved(scene, lifted);
  const Image<float> height = IntegrateNormals(first, *lifted.camera).value();
  const NormalField second = Solved(scene, lifted, Backend::kAuto, height);

  const NormalField on_table = Solved(scene, rig);
  fmt::print(
      "{}: mean {:.3f} degrees on the table, {:.3f} lifted, {:.4f} with relief; worst {:.2f}, "
      "{:.2f}, {:.3f}\n",
      Name(GetParam()), MeanErrorDeg(on_table, scene), MeanErrorDeg(first, scene),
      MeanErrorDeg(second, scene), MaxErrorDeg(on_table, scene), MaxErrorDeg(first, scene),
      MaxErrorDeg(second, scene));
  EXPECT_GT(MeanErrorDeg(first, scene), 0.2);
  EXPECT_LT(MeanErrorDeg(second, scene), MeanErrorDeg(first, scene) / 10.0);
  EXPECT_LT(MaxErrorDeg(second, scene), MaxErrorDeg(first, scene) / 10.0);
  EXPECT_LT(WorstHeightErrorMm(height, scene, first, *rig.camera), 0.7);
}

TEST(Height, OutOfRangeIsRefusedByName) {
  const Rig rig = CloseRig(kDrapeSize);
  const DrapedScene scene = RenderDrape({}, rig);
  const auto message = [&](const Image<float>& height_mm) {
    return SolveLambertian(scene.rendered.stack, rig, std::nullopt, {}, {}, height_mm)
        .error()
        .message;
  };
  EXPECT_THAT(message(Image<float>(3, 2)),
              HasSubstr("heights are 3x2 px but the frames are 140x106"));
  EXPECT_THAT(message(Image<float>(140, 106, std::numeric_limits<float>::quiet_NaN())),
              HasSubstr("need finite numbers"));
  EXPECT_THAT(message(Image<float>(140, 106, 260.0F)), HasSubstr("rises to 260 mm, but lights["));
  EXPECT_THAT(message(Image<float>(140, 106, 600.0F)), HasSubstr("but the camera is at 49"));
  EXPECT_THAT(Lifted(rig, 200.0).error().message,
              HasSubstr("surface is at 200 mm, but lights[1] is at 197.99 mm"));
  EXPECT_FALSE(Lifted(rig, std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace
}  // namespace sateen::height_test
