#include "solver/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <numbers>

namespace sateen::evaluate_test {
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

// A field of solved normals whose slopes are the true ones, which are those of a weave, plus
// `more`.
template <typename More>
double WorstLowFrequencyDeg(ImageSize size, double pitch_mm, const More& more,
                            NormalField* edited = nullptr) {
  NormalField field;
  field.Resize(size);
  Image3 truth(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const size_t p =
          static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
      const Eigen::Vector2d weave(0.4 * std::sin(2.0 * x), 0.4 * std::cos(2.0 * y));
      const Eigen::Vector2d off = more(x * pitch_mm, y * pitch_mm);
      const Eigen::Vector3d t = Eigen::Vector3d(-weave.x(), -weave.y(), 1.0).normalized();
      const Eigen::Vector3d n =
          Eigen::Vector3d(-weave.x() - off.x(), -weave.y() - off.y(), 1.0).normalized();
      for (size_t c = 0; c < 3; ++c) {
        truth[c].pixels[p] = static_cast<float>(t[static_cast<Eigen::Index>(c)]);
        field.normal[c].pixels[p] = static_cast<float>(n[static_cast<Eigen::Index>(c)]);
      }
      field.reason.pixels[p] = static_cast<uint8_t>(Reason::kSolved);
    }
  }
  if (edited != nullptr) {
    // Half of the pixels do not count, whatever they say.
    for (size_t p = 0; p < field.reason.pixels.size(); p += 2) {
      field.reason.pixels[p] = static_cast<uint8_t>(Reason::kDark);
      field.normal[0].pixels[p] = 1.0F;
      field.normal[2].pixels[p] = 0.0F;
    }
  }
  return LowFrequencyErrorDeg(field, truth, pitch_mm).value().max;
}

TEST(LowFrequencyError, PassesHalfThePowerOfAWaveOf50Mm) {
  for (const double pitch_mm : {0.5, 2.0}) {  // squares of one pixel and of fewer
    const auto size = [&](double mm) { return static_cast<int>(mm / pitch_mm); };
    for (const auto& [period_mm, share] : {std::pair{50.0, std::sqrt(0.5)},
                                           {100.0, std::pow(0.5, 0.125)},
                                           {37.5, std::pow(0.5, 0.5 * 16.0 / 9.0)}}) {
      // exp(-2 pi^2 sd^2 f^2) is (1/2)^(1/2 (50 mm f)^2).
      const double worst =
          WorstLowFrequencyDeg({size(300.0), size(200.0)}, pitch_mm, [&](double x_mm, double) {
            return Eigen::Vector2d(0.0, 1e-3 * std::cos(2.0 * std::numbers::pi * x_mm / period_mm));
          });
      // Even about both edges, so that half of G shows there what all of it would.
      EXPECT_NEAR(worst, share * 1e-3 * 180.0 / std::numbers::pi, 0.15 * share * 0.0573)
          << period_mm << " at " << pitch_mm;
    }
  }
}

TEST(LowFrequencyError, KeepsAConstantErrorToItsEdgesWhateverIsUnsolved) {
  NormalField any;
  const auto constant = [](double, double) { return Eigen::Vector2d(3e-3, -4e-3); };

  // Over half of the pixels, the weave of truth and answer cancel all the same.
  EXPECT_NEAR(WorstLowFrequencyDeg({200, 150}, 0.5, constant), 5e-3 * 180.0 / std::numbers::pi,
              1e-5);
  EXPECT_NEAR(WorstLowFrequencyDeg({200, 150}, 0.5, constant, &any),
              5e-3 * 180.0 / std::numbers::pi, 1e-5);
}

TEST(LowFrequencyError, GrowsWithASlopeThatGrowsTowardsTheEdge) {
  const double worst = WorstLowFrequencyDeg({400, 300}, 0.5, [](double x_mm, double) {
    return Eigen::Vector2d(1e-5 * (x_mm - 100.0), 0.0);
  });

  // At the edge the half Gaussian's mean lies 0.8 sd within.
  EXPECT_NEAR(worst, 1e-5 * (100.0 - 0.8 * 6.62) * 180.0 / std::numbers::pi, 2e-3 * 0.0573);
}

// A focal length of 1e15 px asks for this: the image is a speck beside the Gaussian.
TEST(LowFrequencyError, ComparesNothingOnASpeck) {
  for (const double pitch_mm : {1e-13, 1e-300}) {
    const auto compared = LowFrequencyErrorDeg(TiltedRow({0.0}), UpwardTruth(1), pitch_mm);
    ASSERT_TRUE(compared);
    EXPECT_EQ(compared->count, 0);
  }
}

TEST(LowFrequencyError, RefusesTruthOfAnotherSize) {
  EXPECT_EQ(LowFrequencyErrorDeg(TiltedRow({0.0}), UpwardTruth(2), 1.0).error().code,
            ErrorCode::kBadData);
}

TEST(AlbedoErrorMap, IsOfLuminanceOrOfASitesOwnColour) {
  NormalField field = TiltedRow({0.0, 0.0, 0.0});
  Image3 truth(ImageSize{3, 1});
  for (size_t p = 0; p < 3; ++p) {
    for (size_t c = 0; c < 3; ++c) {
      truth[c].pixels[p] = 0.5F;
      field.albedo[c].pixels[p] = std::array{0.6F, 0.5F, 0.45F}[c];
    }
  }
  field.reason.pixels[2] = static_cast<uint8_t>(Reason::kDark);
  const Image<float> of_luminance = AlbedoErrorMap(field, truth).value();
  EXPECT_NEAR(of_luminance.pixels[0], 0.2126 * 0.2 - 0.0722 * 0.1, 1e-6);
  EXPECT_EQ(of_luminance.pixels[2], 0.0F);
  const std::array<uint8_t, 4> cfa = {0, 2, 1, 1};
  const Image<float> of_sites = AlbedoErrorMap(field, truth, &cfa).value();
  EXPECT_NEAR(of_sites.pixels[0], 0.2, 1e-6);
  EXPECT_NEAR(of_sites.pixels[1], 0.1, 1e-6);
  EXPECT_FALSE(AlbedoErrorMap(field, Image3(ImageSize{2, 1})));
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
}  // namespace sateen::evaluate_test
