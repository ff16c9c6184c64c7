#include "scanner/checks/light_patterns.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::light_patterns_test {
namespace {

constexpr size_t kLights = 5;
constexpr size_t kBlocks = 40;

// Light k is brightest at its own end of a row of blocks.
std::vector<BlockField> Predicted() {
  std::vector<BlockField> fields(kLights, BlockField(kBlocks));
  for (size_t k = 0; k < kLights; ++k) {
    for (size_t b = 0; b < kBlocks; ++b) {
      fields[k][b] = std::exp(0.02 * (static_cast<double>(k) - 2.0) * static_cast<double>(b));
    }
  }
  return fields;
}

// Frames of a print: its albedo in every block of every frame.
std::vector<BlockField> Signal(std::vector<BlockField> fields) {
  for (BlockField& field : fields) {
    for (size_t b = 0; b < kBlocks; ++b) {
      field[b] *= b % 3 == 0 ? 0.2 : 0.7;
    }
  }
  return fields;
}

const std::vector<bool> kAllOn(kLights, true);

TEST(LightPatterns, FitEachFrameToItsOwnLightWhateverTheTexture) {
  const LightPatterns patterns(Signal(Predicted()), Predicted(), kAllOn);
  for (size_t k = 0; k < kLights; ++k) {
    EXPECT_EQ(patterns.FitOf(k).best, k);
    EXPECT_NEAR(patterns.FitOf(k).own, 0.0, 1e-12);
  }
}

// The slope of the logarithm differs by 0.04 for each block: its variance over 40 blocks.
TEST(LightPatterns, TellTheLightOfASwappedFrame) {
  std::vector<BlockField> signal = Signal(Predicted());
  std::swap(signal[1], signal[3]);
  const LightPatterns patterns(signal, Predicted(), kAllOn);
  EXPECT_EQ(patterns.FitOf(1).best, 3U);
  EXPECT_EQ(patterns.FitOf(3).best, 1U);
  EXPECT_NEAR(patterns.FitOf(1).own, 0.04 * 0.04 * (kBlocks * kBlocks - 1) / 12.0, 1e-9);
  EXPECT_NEAR(patterns.FitOf(1).least, 0.0, 1e-12);
  EXPECT_EQ(patterns.FitOf(2).best, 2U);
}

TEST(LightPatterns, TellTheSecondLightOfAFrame) {
  const std::vector<BlockField> predicted = Predicted();
  std::vector<BlockField> both = predicted;
  for (size_t b = 0; b < kBlocks; ++b) {
    both[1][b] += predicted[4][b];
  }
  std::vector<bool> on = kAllOn;
  on[1] = false;  // not alone
  EXPECT_EQ(LightPatterns(Signal(both), predicted, on).SecondLight(1), 4U);
}

TEST(LightPatterns, LeaveAsideBlocksWithoutLight) {
  std::vector<BlockField> signal = Signal(Predicted());
  signal[2][7] = 0.0;
  signal[2][8] = -1e-3;
  const LightPatterns patterns(signal, Predicted(), kAllOn);
  EXPECT_EQ(patterns.FitOf(2).best, 2U);
  EXPECT_TRUE(std::isfinite(patterns.FitOf(2).own));
}

}  // namespace
}  // namespace sateen::light_patterns_test
