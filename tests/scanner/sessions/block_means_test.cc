#include "scanner/sessions/block_means.h"

#include <gmock/gmock.h>

#include <random>

namespace sateen::block_means_test {
namespace {

// Noise of a known deviation on light that falls off to the right, in frames of exposure 4: the
// variance is that of one site, of radiance, and the slope is no part of it.
TEST(BlockMeans, SiteVarianceIsThatOfTheNoise) {
  constexpr double kSd = 0.01;
  constexpr double kExposure = 4.0;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, kSd);
  Photo photo{.rgb = Image3(ImageSize{256, 256})};
  for (Image<float>& plane : photo.rgb.planes) {
    for (int y = 0; y < 256; ++y) {
      for (int x = 0; x < 256; ++x) {
        plane.At(x, y) = static_cast<float>(0.8 - 0.001 * x + noise(random));
      }
    }
  }

  const auto means = BlockMeansOf({.path = "a.exr", .exposure = kExposure}, photo, {1, 1});

  ASSERT_TRUE(means) << means.error().message;
  for (const double variance : means->blocks[0].site_variance_rgb) {
    // 65,000 pairs that share sites: the variance is known to 0.7 %.
    EXPECT_NEAR(variance / (kSd * kSd / (kExposure * kExposure)), 1.0, 0.03);
  }
}

}  // namespace
}  // namespace sateen::block_means_test
