#include "imaging/color.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::color_test {
namespace {

TEST(LinearFromSrgb, GivesTheStandardsValues) {
  EXPECT_EQ(LinearFromSrgb(0.0F), 0.0F);
  EXPECT_EQ(LinearFromSrgb(1.0F), 1.0F);  // full scale must stay full scale exactly
  // Worked out from IEC 61966-2-1 with 30 digits; half a float step is 3e-8 of the value.
  EXPECT_NEAR(LinearFromSrgb(0.5F), 0.214041140482232442, 2e-8);
  EXPECT_NEAR(LinearFromSrgb(0.04F), 0.00309597523219814241, 3e-10);
  EXPECT_NEAR(LinearFromSrgb(0.2F), 0.0331047665708850460, 3e-9);
}

TEST(SrgbFromLinear, GivesTheStandardsValues) {
  EXPECT_EQ(SrgbFromLinear(0.0F), 0.0F);
  EXPECT_EQ(SrgbFromLinear(1.0F), 1.0F);
  EXPECT_NEAR(SrgbFromLinear(0.5F), 0.735356983052449491, 6e-8);
  EXPECT_NEAR(SrgbFromLinear(0.001F), 0.01292, 1e-9);
}

TEST(SrgbFromLinear, UndoesLinearFromSrgbForEvery16BitCode) {
  for (int code = 0; code <= 65535; ++code) {
    const float encoded = static_cast<float>(code) / 65535.0F;
    const float back = SrgbFromLinear(LinearFromSrgb(encoded));
    ASSERT_EQ(std::lround(back * 65535.0F), code);
  }
}

TEST(Srgb, IsContinuousWhereItsPiecesMeet) {
  // The standard's rounded constants leave a step of 2e-8 (linear) and 3e-7 (encoded).
  EXPECT_NEAR(LinearFromSrgb(0.04045F), LinearFromSrgb(std::nextafter(0.04045F, 1.0F)), 5e-8);
  EXPECT_NEAR(SrgbFromLinear(0.0031308F), SrgbFromLinear(std::nextafter(0.0031308F, 1.0F)), 1e-6);
}

TEST(Srgb, MirrorsNegativeValues) {
  EXPECT_EQ(LinearFromSrgb(-0.5F), -LinearFromSrgb(0.5F));
  EXPECT_EQ(SrgbFromLinear(-0.5F), -SrgbFromLinear(0.5F));
  EXPECT_EQ(SrgbFromLinear(-0.001F), -SrgbFromLinear(0.001F));
}

TEST(Luminance, OfWhiteIsOne) {
  EXPECT_FLOAT_EQ(kLuminance[0] + kLuminance[1] + kLuminance[2], 1.0F);
}

}  // namespace
}  // namespace sateen::color_test
