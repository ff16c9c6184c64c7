#include "simulation/sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "simulation/random.h"

namespace sateen::sensor_test {
namespace {

using ::testing::HasSubstr;

struct Moments {
  double mean;
  double variance;
};

Moments MomentsOf(const Image<uint16_t>& image) {
  double sum = 0.0;
  double squares = 0.0;
  for (const uint16_t value : image.pixels) {
    sum += value;
    squares += static_cast<double>(value) * value;
  }
  const auto count = static_cast<double>(image.pixels.size());
  return {sum / count, squares / count - (sum / count) * (sum / count)};
}

TEST(Sensor, NoiseVarianceFollowsTheModelAtTenLevels) {
  const Sensor sensor{.bits = 14,
                      .black_dn = 600,
                      .white_dn = 15892,
                      .full_well_electrons = 42000,
                      .read_noise_electrons = 3};
  const double gain = (15892.0 - 600.0) / 42000.0;
  for (int level = 1; level <= 10; ++level) {
    const double radiance = 0.09 * level;
    const auto mosaic = Expose(sensor, Image3({600, 400}, static_cast<float>(radiance)), 7);
    ASSERT_TRUE(mosaic);
    const Moments found = MomentsOf(*mosaic);
    const double electrons = 42000.0 * radiance;
    const double variance = gain * gain * (electrons + 9.0) + 1.0 / 12.0;
    // 240,000 samples: the variance is uncertain by 0.3 %, the mean by sigma / 490.
    EXPECT_NEAR(found.variance / variance, 1.0, 0.02) << radiance;
    EXPECT_NEAR(found.mean, 600.0 + gain * electrons, 5.0 * std::sqrt(variance / 240000.0));
  }
}

TEST(Sensor, ReadNoiseAloneInTheDark) {
  const Sensor sensor{.bits = 16,
                      .black_dn = 1000,
                      .white_dn = 65535,
                      .full_well_electrons = 20000,
                      .read_noise_electrons = 5};
  const auto mosaic = Expose(sensor, Image3({600, 400}), 7);
  ASSERT_TRUE(mosaic);
  const double gain = 64535.0 / 20000.0;
  EXPECT_NEAR(MomentsOf(*mosaic).variance / (gain * gain * 25.0 + 1.0 / 12.0), 1.0, 0.02);
  EXPECT_NEAR(MomentsOf(*mosaic).mean, 1000.0, 0.2);
}

TEST(Sensor, WithoutNoiseRoundsAndSaturates) {
  const Sensor sensor{.bits = 12, .black_dn = 100, .white_dn = 4000, .full_scale = 2.0};
  const auto read = [&](double radiance) {
    return Expose(sensor, Image3({2, 2}, static_cast<float>(radiance)), 1)->pixels[0];
  };
  EXPECT_EQ(read(0.0), 100);
  EXPECT_EQ(read(1.0), 2050);
  EXPECT_EQ(read(1.0002), 2050);
  EXPECT_EQ(read(1.0004), 2051);
  EXPECT_EQ(read(2.5), 4000);
  EXPECT_EQ(read(-1.0), 0);
}

TEST(Sensor, TakesTheColourOfEachSite) {
  Image3 radiance({2, 2});
  radiance[0] = Image<float>(2, 2, 0.25F);
  radiance[1] = Image<float>(2, 2, 0.5F);
  radiance[2] = Image<float>(2, 2, 0.75F);
  for (const std::string_view order : {"RGGB", "GRBG", "GBRG", "BGGR"}) {
    const auto mosaic =
        Expose({.bits = 12, .white_dn = 4000, .cfa = *BayerNamed(order)}, radiance, 1);
    ASSERT_TRUE(mosaic);
    for (size_t site = 0; site < 4; ++site) {
      const int expected = order[site] == 'R' ? 1000 : order[site] == 'G' ? 2000 : 3000;
      EXPECT_EQ(mosaic->pixels[site], expected) << order << site;
    }
  }
  EXPECT_FALSE(BayerNamed("RGBG"));
}

TEST(Sensor, SeesEachColourWithItsOwnSensitivity) {
  const auto mosaic = Expose({.bits = 12, .white_dn = 4000, .sensitivity_rgb = {0.5, 1.0, 0.25}},
                             Image3({2, 2}, 0.5F), 1);
  ASSERT_TRUE(mosaic);
  EXPECT_EQ(mosaic->pixels, (std::vector<uint16_t>{1000, 2000, 2000, 500}));
}

TEST(Sensor, BendsAboveItsKneeAndSaturatesBelowWhite) {
  const Sensor sensor{.bits = 14,
                      .black_dn = 1000,
                      .white_dn = 11000,
                      .saturation_dn = 10900,
                      .knee = 0.8,
                      .compression = 0.04};
  const auto read = [&](double radiance) {
    return Expose(sensor, Image3({2, 2}, static_cast<float>(radiance)), 1)->pixels[0];
  };
  EXPECT_EQ(read(0.8), 9000);
  EXPECT_EQ(read(0.9), 9900);    // 0.9 - 0.04 / 4
  EXPECT_EQ(read(1.0), 10600);   // 1 - 0.04
  EXPECT_EQ(read(1.04), 10840);  // straight on by 1 - 2 0.04 / 0.2
  EXPECT_EQ(read(1.06), 10900);
}

TEST(Sensor, SameBitsOnAnyNumberOfThreads) {
  const Sensor sensor{.full_well_electrons = 1000, .read_noise_electrons = 3};
  const Image3 grey({97, 61}, 0.4F);
  const auto one = Expose(sensor, grey, 5, Task{.threads = 1});
  const auto three = Expose(sensor, grey, 5, Task{.threads = 3});
  const auto other = Expose(sensor, grey, 6, Task{.threads = 3});
  ASSERT_TRUE(one && three && other);
  EXPECT_EQ(one->pixels, three->pixels);
  EXPECT_NE(one->pixels, other->pixels);
}

TEST(Random, DeviatesAreNormalAndUncorrelated) {
  constexpr uint64_t kCount = 200000;
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  double neighbours = 0.0;
  for (uint64_t i = 0; i < kCount; ++i) {
    const double n = NormalDeviate(9, i);
    sum += n;
    squares += n * n;
    fourth += n * n * n * n;
    neighbours += n * NormalDeviate(9, i + 1);
  }
  const auto count = static_cast<double>(kCount);
  EXPECT_NEAR(sum / count, 0.0, 0.01);
  EXPECT_NEAR(squares / count, 1.0, 0.015);
  EXPECT_NEAR(fourth / count, 3.0, 0.12);
  EXPECT_NEAR(neighbours / count, 0.0, 0.01);
}

TEST(Sensor, ErrorsNameTheFieldAndItsRange) {
  const auto message = [](const Sensor& sensor) {
    const Status status = sensor.Validate();
    return status ? std::string("valid") : status.error().message;
  };
  EXPECT_THAT(message({.bits = 10}), HasSubstr("bits = 10; need 12, 14 or 16"));
  EXPECT_THAT(message({.bits = 12, .white_dn = 5000}), HasSubstr("white = 5000"));
  EXPECT_THAT(message({.black_dn = 65535}), HasSubstr("black = 65535"));
  EXPECT_THAT(message({.full_scale = 0}), HasSubstr("full_scale"));
  EXPECT_THAT(message({.saturation_dn = 70000}), HasSubstr("saturation = 70000; need a whole"));
  EXPECT_THAT(message({.black_dn = 9, .saturation_dn = 9}), HasSubstr("saturation = 9"));
  EXPECT_THAT(message({.sensitivity_rgb = {1, 0, 1}}), HasSubstr("sensitivity_rgb = 0"));
  EXPECT_THAT(message({.knee = 1}), HasSubstr("knee = 1"));
  EXPECT_THAT(message({.knee = 0.8, .compression = 0.11}),
              HasSubstr("compression = 0.11; need 0 to 0.1, half of 1 - knee"));
  EXPECT_THAT(message({.full_well_electrons = 0}), HasSubstr("full_well_electrons"));
  EXPECT_THAT(message({.read_noise_electrons = -1}), HasSubstr("read_noise_electrons = -1"));
}

}  // namespace
}  // namespace sateen::sensor_test
