#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scanner/sessions/dataset.h"
#include "tests/imaging/dng.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::raw_frames_test {
namespace {

// A folder of four equal DNG files and their lights.txt.
class RawFrames : public ::testing::Test {
 protected:
  Result<Dataset> Read(const testing::DngSpec& spec) {
    testing::WriteText(temp_.Path() / "lights.txt", testing::Lines(testing::kDirections));
    for (int k = 0; k < 4; ++k) {
      testing::WriteText(temp_.Path() / fmt::format("frame{}.dng", k), testing::DngBytes(spec));
    }
    return ReadDataset(temp_.Path(), {});
  }

 private:
  testing::TempFolder temp_;
};

TEST_F(RawFrames, ComeAsCameraRgbWithBlackSubtractedAndWhiteAtOne) {
  const testing::DngSpec spec;

  const Dataset dataset = Read(spec).value();

  ASSERT_EQ(dataset.stack.size(), 4U);
  EXPECT_EQ(dataset.stack[0].full_scale, 1.0F);
  // Site (20, 10) is red in RGGB and keeps what was measured.
  const float expected = static_cast<float>(testing::Reading(20, 10) - 100) / (4000.0F - 100.0F);
  EXPECT_NEAR(dataset.stack[2].rgb[0].At(20, 10), expected, 1e-6F);
}

TEST_F(RawFrames, ASaturatedSiteSaturatesEveryPixelThatItHasAPartIn) {
  testing::DngSpec spec;
  spec.white = 3000;

  const Image3 rgb = Read(spec).value().stack[0].rgb;

  int saturated_sites = 0;
  for (int y = 2; y < 48; ++y) {
    for (int x = 2; x < 64; ++x) {
      if (testing::Reading(static_cast<uint32_t>(x), static_cast<uint32_t>(y)) < 3000) {
        continue;
      }
      ++saturated_sites;
      const size_t colour = spec.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
      for (const int neighbour : {x - 1, x, x + 1}) {
        ASSERT_GE(rgb[colour].At(neighbour, y), 1.0F) << neighbour << ", " << y;
      }
    }
  }
  EXPECT_GT(saturated_sites, 500);
}

}  // namespace
}  // namespace sateen::raw_frames_test
