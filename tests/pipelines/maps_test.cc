#include "pipelines/solve/maps.h"

#include <gtest/gtest.h>

#include "imaging/show/pictures.h"

namespace sateen::maps_test {
namespace {

TEST(EncodeNormal16, MapsMinusOneZeroAndOne) {
  Image3 normal(ImageSize{3, 1});
  normal[0].pixels = {-1.0F, 0.0F, 1.0F};

  const auto encoded = EncodeNormal16(normal);

  EXPECT_EQ(encoded[0].pixels[0], 0);
  EXPECT_EQ(encoded[0].pixels[1], 32768);
  EXPECT_EQ(encoded[0].pixels[2], 65535);
}

TEST(ShowHeat, RunsFromBlackToWhiteAndGreysTheUnknown) {
  Image<float> values(3, 1);
  values.pixels = {0.0F, 5.0F, 5.0F};
  Image<uint8_t> shown(3, 1, 1);
  shown.pixels[2] = 0;

  const Rgb8 heat = ShowHeat(values, 5.0F, shown);

  EXPECT_EQ(heat[0].pixels[0], 0);
  EXPECT_EQ(heat[2].pixels[1], 255);
  EXPECT_EQ(heat[0].pixels[2], heat[1].pixels[2]);
  EXPECT_NE(heat[0].pixels[2], 0);
}

TEST(ShowLinear, SurvivesImagesWithoutLight) {
  Image3 black(ImageSize{2, 1});
  black[0].pixels[0] = std::numeric_limits<float>::quiet_NaN();

  EXPECT_EQ(ShowLinear(black)[0].pixels[0], 0);
  EXPECT_EQ(ShowLinear(black)[1].pixels[1], 0);
}

TEST(SideBySide, ShrinksByWholeFactorsAndKeepsTheOrder) {
  const Rgb8 dark = {Image<uint8_t>(100, 50, 10), Image<uint8_t>(100, 50, 10),
                     Image<uint8_t>(100, 50, 10)};
  const Rgb8 light = {Image<uint8_t>(100, 50, 200), Image<uint8_t>(100, 50, 200),
                      Image<uint8_t>(100, 50, 200)};

  const Rgb8 sheet = SideBySide({dark, light}, 40);

  EXPECT_EQ(sheet[0].width, 33 + 4 + 33);  // factor 3, a gap of 4
  EXPECT_EQ(sheet[0].height, 16);
  EXPECT_EQ(sheet[0].At(0, 0), 10);
  EXPECT_EQ(sheet[0].At(35, 0), 255);
  EXPECT_EQ(sheet[0].At(69, 15), 200);
}

}  // namespace
}  // namespace sateen::maps_test
