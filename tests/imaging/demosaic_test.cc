#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "imaging/raw.h"
#include "tests/imaging/dng.h"
#include "tests/testing/files.h"

namespace sateen::demosaic_test {
namespace {

using testing::kBayerOrders;

// Samples `rgb` through the colour filters.
template <typename Rgb>
RawMosaic Mosaic(ImageSize size, const std::array<uint8_t, 4>& cfa, Rgb rgb) {
  RawMosaic mosaic;
  mosaic.cfa = cfa;
  mosaic.samples = Image<float>(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      mosaic.samples.At(x, y) = rgb(x, y, cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
    }
  }
  return mosaic;
}

TEST(Demosaic, WhiteBalanceMultipliesTheChannelsOnlyWhenAsked) {
  const RawMosaic grey = Mosaic({4, 4}, kBayerOrders[0], [](int, int, int) { return 0.25F; });

  EXPECT_EQ(Demosaic(grey)[0].At(1, 1), 0.25F);
  const Image3 balanced = Demosaic(grey, {2.0F, 1.0F, 1.5F});
  EXPECT_EQ(balanced[0].At(1, 1), 0.5F);
  EXPECT_EQ(balanced[1].At(1, 1), 0.25F);
  EXPECT_EQ(balanced[2].At(1, 1), 0.375F);
}

TEST(Demosaic, IsExactOnLinearRampsAwayFromTheBorder) {
  // Multiples of 1/256: every sum and half of them is exact in float.
  const auto ramp = [](int x, int y, int c) {
    return static_cast<float>((c + 1) * 40 + x * (3 - c) + y * (2 * c - 1)) / 256.0F;
  };
  for (const auto& cfa : kBayerOrders) {
    const Image3 rgb = Demosaic(Mosaic({14, 11}, cfa, ramp));
    for (int y = 1; y < 10; ++y) {
      for (int x = 1; x < 13; ++x) {
        for (int c = 0; c < 3; ++c) {
          ASSERT_EQ(rgb[static_cast<size_t>(c)].At(x, y), ramp(x, y, c))
              << x << ' ' << y << ' ' << c;
        }
      }
    }
  }
}

TEST(Demosaic, IsExactOnConstantsUpToTheBorder) {
  const auto constant = [](int, int, int c) { return 0.1F + 0.3F * static_cast<float>(c); };
  for (const auto& cfa : kBayerOrders) {
    for (const ImageSize size : {ImageSize{2, 2}, {3, 2}, {2, 5}, {7, 6}}) {
      const Image3 rgb = Demosaic(Mosaic(size, cfa, constant));
      for (size_t c = 0; c < 3; ++c) {
        for (const float value : rgb[c].pixels) {
          ASSERT_EQ(value, constant(0, 0, static_cast<int>(c)));
        }
      }
    }
  }
}

TEST(Demosaic, KeepsMeasuredValues) {
  std::mt19937 random(3);
  for (const auto& cfa : kBayerOrders) {
    const RawMosaic mosaic = Mosaic({9, 8}, cfa, [&random](int, int, int) {
      return std::uniform_real_distribution<float>(-0.1F, 1.1F)(random);
    });
    const Image3 rgb = Demosaic(mosaic);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 9; ++x) {
        ASSERT_EQ(rgb[cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]].At(x, y),
                  mosaic.samples.At(x, y));
      }
    }
  }
}

TEST(Demosaic, SpreadsOneSiteToItsNeighboursOnly) {
  // A red site of 1 gives half to its side neighbours and a quarter to its corner neighbours.
  RawMosaic mosaic = Mosaic({8, 8}, {0, 1, 1, 2}, [](int, int, int) { return 0.0F; });
  mosaic.samples.At(4, 4) = 1.0F;
  const Image3 rgb = Demosaic(mosaic);
  double sum = 0.0;
  for (const float value : rgb[0].pixels) {
    sum += static_cast<double>(value);
  }
  EXPECT_EQ(rgb[0].At(3, 4), 0.5F);
  EXPECT_EQ(rgb[0].At(4, 5), 0.5F);
  EXPECT_EQ(rgb[0].At(5, 3), 0.25F);
  EXPECT_EQ(sum, 4.0);
  EXPECT_EQ(*std::ranges::max_element(rgb[1].pixels), 0.0F);
}

TEST(Demosaic, SpreadsOneGreenSiteToFourNeighbours) {
  RawMosaic mosaic = Mosaic({8, 8}, {0, 1, 1, 2}, [](int, int, int) { return 0.0F; });
  mosaic.samples.At(4, 3) = 1.0F;
  const Image3 rgb = Demosaic(mosaic);
  for (const auto& [x, y] : {std::pair{3, 3}, {5, 3}, {4, 2}, {4, 4}}) {
    EXPECT_EQ(rgb[1].At(x, y), 0.25F) << x << ' ' << y;
  }
  EXPECT_EQ(std::ranges::count(rgb[1].pixels, 0.0F), 64 - 5);
  EXPECT_EQ(*std::ranges::max_element(rgb[0].pixels), 0.0F);
}

float MedianAround(const Image<float>& plane, int x, int y) {
  std::vector<float> values;
  for (int dy = -15; dy <= 15; ++dy) {
    for (int dx = -15; dx <= 15; ++dx) {
      values.push_back(plane.At(x + dx, y + dy));
    }
  }
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

TEST(Demosaic, ShowsTheGreysOfARealChartInOrder) {
  SATEEN_NEEDS_DATA("raw");
  const Result<RawMosaic> mosaic = ReadRawMosaic(testing::DataDir() / "raw" / "colorchart.dng");
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  // Noise reads a little below black, the brightest window well below white.
  EXPECT_GE(*std::ranges::min_element(mosaic->samples.pixels), -0.02F);
  EXPECT_LE(*std::ranges::max_element(mosaic->samples.pixels), 1.0F);
  const Image3 rgb = Demosaic(*mosaic);

  constexpr int kPatches[6][2] = {{703, 929},  {811, 928},  {921, 928},
                                  {1033, 924}, {1144, 921}, {1259, 920}};
  // Density of the ColorChecker's grey row: 0.05 to 1.50, as reflectance.
  constexpr float kReflectance[6] = {0.900F, 0.591F, 0.362F, 0.198F, 0.090F, 0.031F};
  const float white = MedianAround(rgb[1], kPatches[0][0], kPatches[0][1]);
  EXPECT_GT(white, 0.05F);
  for (int i = 0; i < 6; ++i) {
    const float grey = MedianAround(rgb[1], kPatches[i][0], kPatches[i][1]);
    // Uneven light and flare of an unprepared room: a twentieth of the white patch.
    EXPECT_NEAR(grey / white, kReflectance[i] / kReflectance[0], 0.05F) << i;
  }
  // The red patch is red: the colours of the pattern are not mixed up.
  EXPECT_GT(MedianAround(rgb[0], 925, 822), 1.2F * MedianAround(rgb[1], 925, 822));
}

}  // namespace
}  // namespace sateen::demosaic_test
