#include "solver/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sateen {
namespace {

using ::testing::HasSubstr;

// A row of solved pixels with the given tilts about the y axis.
NormalField TiltedRow(const std::vector<double>& tilts_deg) {
  NormalField field;
  field.Resize({static_cast<int>(tilts_deg.size()), 1});
  for (size_t p = 0; p < tilts_deg.size(); ++p) {
    const double tilt_rad = tilts_deg[p] * std::numbers::pi / 180.0;
    field.normal[0].pixels[p] = static_cast<float>(std::sin(tilt_rad));
    field.normal[2].pixels[p] = static_cast<float>(std::cos(tilt_rad));
    field.reason.pixels[p] = static_cast<uint8_t>(Reason::kSolved);
  }
  return field;
}

Image3 UpwardTruth(int width) {
  Image3 truth(ImageSize{width, 1});
  truth[2] = Image<float>(width, 1, 1.0F);
  return truth;
}

TEST(AngularErrorDeg, GivesMeanMedianPercentileAndMaximum) {
  const NormalField field = TiltedRow({0.0, 1.0, 2.0, 3.0, 10.0});

  const ErrorStatistics error = AngularErrorDeg(field, UpwardTruth(5)).value();

  // Float normals carry angles of degrees to about 4e-6 degrees.
  EXPECT_EQ(error.count, 5);
  EXPECT_NEAR(error.mean, 3.2, 1e-5);
  EXPECT_NEAR(error.median, 2.0, 1e-5);
  EXPECT_NEAR(error.p99, 3.0 + 0.96 * 7.0, 1e-5);  // 0.99 of the way through four intervals
  EXPECT_NEAR(error.max, 10.0, 1e-5);
}

TEST(AngularErrorDeg, SeesAnglesThatTheCosineHides) {
  // cos(1e-4 degrees) rounds to 1 in float; the sine does not.
  const ErrorStatistics error = AngularErrorDeg(TiltedRow({1e-4}), UpwardTruth(1)).value();

  EXPECT_NEAR(error.max, 1e-4, 1e-9);
}

TEST(AngularErrorDeg, OppositeNormalsAre180DegreesApart) {
  const ErrorStatistics error = AngularErrorDeg(TiltedRow({180.0}), UpwardTruth(1)).value();

  EXPECT_NEAR(error.max, 180.0, 1e-4);
}

TEST(AngularErrorDeg, LeavesOutUnsolvedPixelsAndUnknownTruth) {
  NormalField field = TiltedRow({5.0, 20.0, 30.0});
  field.reason.pixels[1] = static_cast<uint8_t>(Reason::kDark);
  Image3 truth = UpwardTruth(3);
  truth[2].pixels[2] = 0.0F;
  Image<float> map;

  const ErrorStatistics error = AngularErrorDeg(field, truth, &map).value();

  EXPECT_EQ(error.count, 1);
  EXPECT_NEAR(error.max, 5.0, 1e-5);
  EXPECT_NEAR(map.pixels[0], 5.0F, 1e-5F);
  EXPECT_EQ(map.pixels[1], 0.0F);
  EXPECT_EQ(map.pixels[2], 0.0F);
}

TEST(AngularErrorDeg, RefusesTruthOfAnotherSize) {
  const Result<ErrorStatistics> error = AngularErrorDeg(TiltedRow({0.0}), UpwardTruth(2));

  ASSERT_FALSE(error);
  EXPECT_EQ(error.error().code, ErrorCode::kBadData);
  EXPECT_THAT(error.error().message, HasSubstr("2x1 px but the solved ones 1x1 px"));
}

TEST(RelativeAlbedoError, IsRelativeToTheTruthOfEachChannel) {
  NormalField field = TiltedRow({0.0});
  field.albedo[0].pixels[0] = 0.55F;
  field.albedo[1].pixels[0] = 0.19F;
  Image3 truth(ImageSize{1, 1});
  truth[0].pixels[0] = 0.5F;
  truth[1].pixels[0] = 0.2F;  // blue: truth 0, left out

  const ErrorStatistics error = RelativeAlbedoError(field, truth).value();

  EXPECT_EQ(error.count, 2);
  EXPECT_NEAR(error.max, 0.10, 1e-6);
  EXPECT_NEAR(error.mean, 0.075, 1e-6);
}

}  // namespace
}  // namespace sateen
