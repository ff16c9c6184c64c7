#include <algorithm>
#include <cmath>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::real_captures_test {
namespace {

namespace fs = std::filesystem;

using testing::DataDir;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MustRead;
using ::testing::SizeIs;

auto PixelsIn(const Mask& mask) {
  return std::count_if(mask.pixels.begin(), mask.pixels.end(), [](uint8_t m) { return m != 0; });
}

Eigen::Vector3d NormalAt(const Truth& truth, size_t p) {
  return Eigen::Vector3f(truth.normal[0].pixels[p], truth.normal[1].pixels[p],
                         truth.normal[2].pixels[p])
      .cast<double>();
}

// Mean over the masked pixels of the correlation, across the lights, between what was measured and
// what the true normal predicts of a matt surface: low where an axis of truth or lights is flipped.
double MeanCorrelation(const Dataset& dataset, const Eigen::Vector3d& sign) {
  const auto count = static_cast<double>(dataset.stack.size());
  double sum = 0.0;
  int pixels = 0;
  for (size_t p = 0; p < dataset.mask->pixels.size(); ++p) {
    if (dataset.mask->pixels[p] == 0) {
      continue;
    }
    const Eigen::Vector3d n = NormalAt(*dataset.truth, p).cwiseProduct(sign);
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    for (size_t k = 0; k < dataset.stack.size(); ++k) {
      const Light& light = dataset.rig.lights[k];
      const double predicted = std::max(0.0, n.dot(light.direction));
      const double measured =
          static_cast<double>(dataset.stack[k].rgb[1].pixels[p]) / light.flux_rgb.y();
      a += predicted, b += measured;
      aa += predicted * predicted, bb += measured * measured, ab += predicted * measured;
    }
    const double spread = std::sqrt((count * aa - a * a) * (count * bb - b * b));
    if (spread > 0.0) {
      sum += (count * ab - a * b) / spread;
      ++pixels;
    }
  }
  return sum / pixels;
}

TEST(DiligentBall, IsReadAsItIs) {
  SATEEN_NEEDS_DATA("diligent-ball");
  const Dataset dataset = MustRead(DataDir() / "diligent-ball");
  EXPECT_EQ(dataset.layout, "diligent");
  ASSERT_THAT(dataset.stack, SizeIs(96));
  EXPECT_EQ(dataset.stack[95].rgb.Size(), (ImageSize{612, 512}));
  EXPECT_THAT(dataset.stack[95].name, HasSubstr("096.png"));
  EXPECT_EQ(dataset.stack[0].full_scale, 1.0F);
  EXPECT_EQ(dataset.rig.lights[0].flux_rgb, Eigen::Vector3d(1.2909, 1.5776, 2.1336));
  ASSERT_TRUE(dataset.mask);
  EXPECT_EQ(PixelsIn(*dataset.mask), 15791);
  EXPECT_THAT(dataset.warnings, IsEmpty());
  EXPECT_THAT(dataset.sha256_of_input, SizeIs(96 + 3 + 2));
}

TEST(DiligentBall, TruthFacesTheViewerAndAgreesWithTheFrames) {
  SATEEN_NEEDS_DATA("diligent-ball");
  const Dataset dataset = MustRead(DataDir() / "diligent-ball");
  ASSERT_TRUE(dataset.truth);
  int level_px = 0;
  for (size_t p = 0; p < dataset.mask->pixels.size(); ++p) {
    const Eigen::Vector3d n = NormalAt(*dataset.truth, p);
    ASSERT_NEAR(n.norm(), dataset.mask->pixels[p] != 0 ? 1.0 : 0.0, 1e-5) << p;
    ASSERT_GE(n.z(), 0.0) << p;
    level_px += dataset.mask->pixels[p] != 0 && n.z() == 0.0 ? 1 : 0;
  }
  EXPECT_EQ(level_px, 72);  // the set has them right on the silhouette
  // x right, y up: mirrored either way, the truth would not explain what was measured.
  EXPECT_GT(MeanCorrelation(dataset, {1, 1, 1}), 0.94);
  EXPECT_LT(MeanCorrelation(dataset, {-1, 1, 1}), 0.8);
  EXPECT_LT(MeanCorrelation(dataset, {1, -1, 1}), 0.8);
}

TEST(DiligentBall, MatlabTruthEqualsTheImage) {
  SATEEN_NEEDS_DATA("diligent-ball");
  const fs::path dir = DataDir() / "diligent-ball";
  std::map<std::string, std::string> hashes;
  const Result<Truth> mat = ReadTruth({dir / "Normal_gt.mat", {}}, {612, 512}, hashes);
  const Result<Truth> exr = ReadTruth({dir / "normal_gt.exr", {}}, {612, 512}, hashes);
  ASSERT_TRUE(mat) << mat.error().message;
  ASSERT_TRUE(exr) << exr.error().message;
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(mat->normal[c].pixels, exr->normal[c].pixels);
  }
}

TEST(UwCat, IsReadInNaturalOrderWithItsMask) {
  SATEEN_NEEDS_DATA("uw-psm");
  const Dataset dataset = MustRead(DataDir() / "uw-psm/cat");
  EXPECT_EQ(dataset.layout, "lights.txt");
  ASSERT_THAT(dataset.stack, SizeIs(12));
  for (size_t k = 0; k < 12; ++k) {
    EXPECT_THAT(dataset.stack[k].name, HasSubstr(fmt::format("cat.{}.tga", k)));
  }
  EXPECT_EQ(dataset.stack[0].rgb.Size(), (ImageSize{512, 340}));
  ASSERT_TRUE(dataset.mask);
  EXPECT_GT(PixelsIn(*dataset.mask), 0);
  EXPECT_FALSE(dataset.truth);
  ASSERT_THAT(dataset.warnings, SizeIs(1));
  EXPECT_THAT(dataset.warnings[0], HasSubstr("precision of 8 bits"));
}

TEST(Bunny, SharesLightsMaskAndTruthOneFolderUp) {
  SATEEN_NEEDS_DATA("bunny");
  const Dataset dataset = MustRead(DataDir() / "bunny/specular");
  ASSERT_THAT(dataset.stack, SizeIs(50));
  EXPECT_EQ(dataset.stack[0].rgb.Size(), (ImageSize{256, 256}));
  EXPECT_TRUE(std::isinf(dataset.stack[0].full_scale));
  ASSERT_TRUE(dataset.mask);
  ASSERT_TRUE(dataset.truth);
  EXPECT_THAT(dataset.warnings, IsEmpty());
}

TEST(Bunny, TruthAgreesWithTheFrames) {
  SATEEN_NEEDS_DATA("bunny");
  const Dataset dataset = MustRead(DataDir() / "bunny/lambert");
  EXPECT_GT(MeanCorrelation(dataset, {1, 1, 1}), 0.95);
  EXPECT_LT(MeanCorrelation(dataset, {-1, 1, 1}), 0.8);
  EXPECT_LT(MeanCorrelation(dataset, {1, -1, 1}), 0.8);
}

}  // namespace
}  // namespace sateen::real_captures_test
