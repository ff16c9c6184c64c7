#include "reflectance/gloss.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::gloss_test {
namespace {

TEST(Gloss, Row1_01_NewAndOldMaps) {
  EXPECT_NEAR(AlphaFromGloss(0.0), 1.0, 1e-15);
  EXPECT_NEAR(AlphaFromGloss(0.5), 0.062439, 5e-7);
  EXPECT_NEAR(AlphaFromGloss(1.0), 0.00276213, 5e-9);
  EXPECT_NEAR(AlphaFromOldGloss(0.0), 0.816497, 5e-7);
  EXPECT_NEAR(AlphaFromOldGloss(1.0), 0.00552, 5e-6);
  // Eq. 1 at g = 1/8 and eq. 2 at g = 1/9, where both powers of 2 are 4.
  EXPECT_NEAR(AlphaFromOldGloss(0.125), std::sqrt(2.0 / 6.0), 1e-15);
  EXPECT_NEAR(AlphaFromGloss(1.0 / 9.0), std::sqrt(2.0 / 5.0), 1e-15);
}

TEST(Gloss, Row2_05_SpecularPowerCodec) {
  EXPECT_NEAR(SpecularPowerFromGloss(0.0), 2.0, 1e-12);
  EXPECT_NEAR(SpecularPowerFromGloss(0.5), 64.0, 1e-12);
  EXPECT_NEAR(SpecularPowerFromGloss(1.0), 2048.0, 1e-9);
  // One code of 255 is a step of 2^(10 / 255).
  const double step = SpecularPowerFromGloss(101.0 / 255.0) / SpecularPowerFromGloss(100.0 / 255.0);
  EXPECT_NEAR(step - 1.0, 0.027555, 5e-7);
}

// Every 8-bit code comes back from its inverse far more exactly than half a code.
TEST(Gloss, EveryCodeComesBack) {
  for (int code = 0; code <= 255; ++code) {
    const double g = code / 255.0;
    EXPECT_NEAR(GlossFromAlpha(AlphaFromGloss(g)), g, 1e-12);
    EXPECT_NEAR(OldGlossFromAlpha(AlphaFromOldGloss(g)), g, 1e-12);
    EXPECT_NEAR(GlossFromSpecularPower(SpecularPowerFromGloss(g)), g, 1e-12);
    EXPECT_NEAR(GltfRoughnessFromAlpha(AlphaFromGltfRoughness(g)), g, 1e-12);
    const double power = SpecularPowerFromGloss(g);
    EXPECT_NEAR(SpecularPowerFromAlpha(AlphaFromSpecularPower(power)) / power, 1.0, 1e-12);
  }
}

TEST(Gloss, PowerAndAlphaAgreeAtKnownPoints) {
  EXPECT_NEAR(AlphaFromSpecularPower(0.0), 1.0, 1e-15);
  EXPECT_NEAR(AlphaFromSpecularPower(6.0), 0.5, 1e-15);
  EXPECT_NEAR(SpecularPowerFromAlpha(0.1), 198.0, 1e-10);
}

// The roughness that a glTF file needs for gloss 0, 0.1, 0.2, 0.3, 0.5; and cloth, alpha 0.4 and
// up, ends at code 50.
TEST(Gloss, GltfRoughnessIsTheRootOfAlpha) {
  const auto roughness = [](double gloss) { return GltfRoughnessFromAlpha(AlphaFromGloss(gloss)); };
  EXPECT_NEAR(roughness(0.0), 1.000, 5e-4);
  EXPECT_NEAR(roughness(0.1), 0.817, 5e-4);
  EXPECT_NEAR(roughness(0.2), 0.625, 5e-4);
  EXPECT_NEAR(roughness(0.3), 0.464, 5e-4);
  EXPECT_NEAR(roughness(0.5), 0.250, 5e-4);
  EXPECT_NEAR(255.0 * GlossFromAlpha(0.4), 50.0, 0.5);
}

}  // namespace
}  // namespace sateen::gloss_test
