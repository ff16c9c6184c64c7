#include "simulation/virtual_rig/camera/scene_frame.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "simulation/virtual_rig/normal_quantiles.h"
#include "tests/simulation/virtual_rig/small_scene.h"

namespace sateen::testing::scene_frame_test {
namespace {

const Sensor kPlain{};  // 16 bits, white at 1, no noise
const Sensor kNoisy{.bits = 14,
                    .black_dn = 600,
                    .white_dn = 15892,
                    .full_well_electrons = 42000,
                    .read_noise_electrons = 3};

FrameState Lit(std::initializer_list<std::pair<size_t, double>> lights) {
  FrameState state{.shares = std::vector<double>(10)};
  for (const auto& [light, share] : lights) {
    state.shares[light] = share;
  }
  return state;
}

// Returns the reading at a site of a sensor without noise and with black 0, as part of white.
double At(const FrameState& state, int x, int y) {
  return FrameOfScene(SmallScene(), kPlain, state).At(x, y) / 65535.0;
}
constexpr double kReading = 0.6 / 65535.0;  // tolerance for rounding

// Colours of the sites of a Bayer sensor.
size_t ColourAt(int x, int y) { return kPlain.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]; }

TEST(SceneFrame, IsTheSumOfItsLightsAndTheAmbientLight) {
  for (const auto& [x, y] : {std::pair(0, 0), {5, 2}, {8, 7}, {63, 47}}) {
    const size_t c = ColourAt(x, y);
    const double a = SmallRadiance(2, c, x, y);
    const double b = SmallRadiance(7, c, x, y);
    EXPECT_NEAR(At(Lit({}), x, y), kSmallAmbient, kReading);
    EXPECT_NEAR(At(Lit({{2, 1.0}}), x, y), a + kSmallAmbient, kReading);
    EXPECT_NEAR(At(Lit({{2, 0.5}, {7, 0.25}}), x, y), 0.5 * a + 0.25 * b + kSmallAmbient, kReading);
    FrameState state = Lit({{2, 1.0}});
    state.ambient = 5.0;
    EXPECT_NEAR(At(state, x, y), a + 5.0 * kSmallAmbient, kReading);
  }
}

TEST(SceneFrame, GoesWithTheExposure) {
  FrameState state = Lit({{2, 1.0}});
  const double once = At(state, 6, 9);
  state.exposure = 2.5;
  EXPECT_NEAR(At(state, 6, 9), 2.5 * once, 3.0 * kReading);
}

TEST(SceneFrame, WithoutNoiseReadsAsTheSensorDoes) {
  Sensor sensor{.bits = 12,
                .black_dn = 100,
                .white_dn = 4000,
                .saturation_dn = 3900,
                .knee = 0.5,
                .compression = 0.2};
  FrameState state = Lit({{9, 1.0}});
  state.exposure = 7.07;
  state.ambient = 0.0;
  Image3 radiance = SmallPicture(9);
  for (Image<float>& plane : radiance.planes) {
    for (float& value : plane.pixels) {
      value *= 7.07F;
    }
  }
  const Image<uint16_t> expected = *Expose(sensor, radiance, /*seed=*/1);
  const Image<uint16_t> found = FrameOfScene(SmallScene(), sensor, state);
  EXPECT_EQ(std::ranges::max(expected.pixels), 3900);
  int differ = 0;
  for (size_t p = 0; p < found.pixels.size(); ++p) {
    ASSERT_NEAR(found.pixels[p], expected.pixels[p], 1.0) << p;
    differ += found.pixels[p] != expected.pixels[p] ? 1 : 0;
  }
  EXPECT_LE(differ, 3);  // floats and doubles round to either side where they are half way
}

TEST(SceneFrame, NoiseHasTheVarianceOfTheSensor) {
  const ImageSize size = {600, 400};
  const double gain = (15892.0 - 600.0) / 42000.0;
  for (const double level : {0.0, 0.01, 0.1, 0.5, 0.9}) {
    LitScene scene{.lights = {Image<float>(size, 1.0F)}, .ambient = Image<float>(size)};
    const auto frame = FrameOfScene(scene, kNoisy, {.shares = {level}});
    double sum = 0.0;
    double squares = 0.0;
    double beside = 0.0;
    const double mean = 600.0 + gain * 42000.0 * level;
    for (size_t p = 0; p < frame.pixels.size(); ++p) {
      const double d = frame.pixels[p] - mean;
      sum += d;
      squares += d * d;
      beside += p > 0 ? d * (frame.pixels[p - 1] - mean) : 0.0;
    }
    const auto count = static_cast<double>(frame.pixels.size());
    const double variance = gain * gain * (42000.0 * level + 9.0) + 1.0 / 12.0;
    // 240,000 samples: the variance is uncertain by 0.3 %, the mean by sigma / 490.
    EXPECT_NEAR(squares / count / variance, 1.0, 0.02) << level;
    EXPECT_NEAR(sum / count, 0.0, 5.0 * std::sqrt(variance / count)) << level;
    EXPECT_NEAR(beside / count / variance, 0.0, 0.01) << level;  // sites are independent
  }
}

TEST(SceneFrame, QuantilesAreThoseOfTheNormalDistribution) {
  double sum = 0.0;
  double squares = 0.0;
  double fourths = 0.0;
  std::array<int, 3> above = {};
  const NormalQuantiles& normal = NormalQuantiles::Table();
  for (uint64_t i = 0; i < NormalQuantiles::kCount; ++i) {
    const double z = normal[i];
    EXPECT_EQ(normal[i + (uint64_t{7} << 40U)], normal[i]);  // by 16 bits
    sum += z;
    squares += z * z;
    fourths += z * z * z * z;
    for (size_t k = 0; k < above.size(); ++k) {
      above[k] += z > static_cast<double>(k + 1) ? 1 : 0;
    }
  }
  const auto count = static_cast<double>(NormalQuantiles::kCount);
  EXPECT_NEAR(sum / count, 0.0, 1e-9);
  EXPECT_NEAR(squares / count, 1.0, 1e-6);
  EXPECT_NEAR(fourths / count, 3.0, 0.01);  // the farthest tails are cut
  for (size_t k = 0; k < above.size(); ++k) {
    const double share = 0.5 * std::erfc(static_cast<double>(k + 1) / std::sqrt(2.0));
    EXPECT_NEAR(above[k] / count, share, 3e-5) << k + 1;
  }
}

TEST(SceneFrame, EqualStatesAreEqualBitsAndOthersAreIndependent) {
  const LitScene scene = SmallScene();
  FrameState state = Lit({{2, 1.0}});
  const Image<uint16_t> frame = FrameOfScene(scene, kNoisy, state);
  EXPECT_EQ(FrameOfScene(scene, kNoisy, state).pixels, frame.pixels);
  // So little more light changes few means, and all of the noise.
  FrameState other = state;
  other.exposure = 1.0 + 1e-6;
  const Image<uint16_t> next = FrameOfScene(scene, kNoisy, other);
  double product = 0.0;
  double squares = 0.0;
  const Image<uint16_t> mean =
      FrameOfScene(scene, {.bits = 14, .black_dn = 600, .white_dn = 15892}, state);
  for (size_t p = 0; p < frame.pixels.size(); ++p) {
    const double a = frame.pixels[p] - mean.pixels[p];
    product += a * (next.pixels[p] - mean.pixels[p]);
    squares += a * a;
  }
  EXPECT_NEAR(product / squares, 0.0, 0.1);  // 3072 samples: 0.018
  for (const double shift : {0.0, 1.0}) {
    FrameState moved = state;
    (shift > 0.0 ? moved.shift_x_px : moved.ambient) = 0.5;
    EXPECT_NE(FrameOfScene(scene, kNoisy, moved).pixels, frame.pixels);
  }
}

// A plane in each colour: bilinear interpolation gives it exactly.
LitScene Ramp() {
  LitScene scene{.lights = {Image<float>(kSmallPx)}, .ambient = Image<float>(kSmallPx)};
  for (int y = 0; y < kSmallPx.height; ++y) {
    for (int x = 0; x < kSmallPx.width; ++x) {
      scene.lights[0].At(x, y) = 0.1F + 0.2F * static_cast<float>(ColourAt(x, y)) +
                                 0.004F * static_cast<float>(x) + 0.002F * static_cast<float>(y);
    }
  }
  return scene;
}

TEST(SceneFrame, ANudgeMovesThePictureRightAndDownInEachColour) {
  const LitScene scene = Ramp();
  const Image<uint16_t> before = FrameOfScene(scene, kPlain, {.shares = {1.0}});
  for (const auto& [dx, dy] : {std::pair(3.0, 0.0), {0.0, -2.0}, {-1.25, 4.5}, {0.4, 0.0}}) {
    const Image<uint16_t> after =
        FrameOfScene(scene, kPlain, {.shares = {1.0}, .shift_x_px = dx, .shift_y_px = dy});
    for (int y = 6; y < kSmallPx.height - 6; ++y) {
      for (int x = 6; x < kSmallPx.width - 6; ++x) {
        ASSERT_NEAR(after.At(x, y), before.At(x, y) - 65535.0 * (0.004 * dx + 0.002 * dy), 1.1)
            << x << ' ' << y << ' ' << dx << ' ' << dy;
      }
    }
  }
}

TEST(SceneFrame, AnEvenNudgeMovesSitesAsTheyAreAndRepeatsTheBorder) {
  const Image<uint16_t> before = FrameOfScene(SmallScene(), kPlain, Lit({{3, 1.0}}));
  FrameState state = Lit({{3, 1.0}});
  state.shift_x_px = 4.0;
  state.shift_y_px = -2.0;
  const Image<uint16_t> after = FrameOfScene(SmallScene(), kPlain, state);
  EXPECT_EQ(after.At(20, 20), before.At(16, 22));
  EXPECT_EQ(after.At(63, 45), before.At(59, 47));
  EXPECT_EQ(after.At(1, 47), before.At(1, 47));  // the border of its own colour
  EXPECT_EQ(after.At(2, 46), before.At(0, 46));
  state.shift_x_px = 1e5;
  EXPECT_EQ(FrameOfScene(SmallScene(), kPlain, state).At(30, 10), before.At(0, 12));
}

TEST(SceneFrame, AShadeDarkensItsDisc) {
  FrameState state = Lit({{3, 1.0}});
  const double bright = At(state, 20, 20);
  const double outside = At(state, 26, 20);
  state.shades = {{.x_px = 20, .y_px = 21, .radius_px = 5, .factor = 0.25}};
  EXPECT_NEAR(At(state, 20, 20), 0.25 * bright, 2 * kReading);
  EXPECT_EQ(At(state, 26, 20), outside);
}

}  // namespace
}  // namespace sateen::testing::scene_frame_test
