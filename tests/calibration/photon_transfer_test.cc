#include "calibration/response/photon_transfer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::photon_transfer_test {
namespace {

constexpr double kGain = 0.5;
constexpr double kReadVariance = 4.0;
constexpr double kCount = 201.0;  // sites of a point

double VarianceAt(double mean_dn) { return kGain * mean_dn + kReadVariance + 1.0 / 12.0; }

// Each colour has `repeats` points at either mean.
std::vector<TransferPoint> PointsAt(double dark_dn, double lit_dn, int repeats) {
  std::vector<TransferPoint> points;
  for (int i = 0; i < repeats; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      points.push_back({dark_dn, VarianceAt(dark_dn), kCount, c, /*is_dark=*/dark_dn == 0.0});
      points.push_back({lit_dn, VarianceAt(lit_dn), kCount, c, /*is_dark=*/false});
    }
  }
  return points;
}

// A variance v of n sites has the standard deviation v sqrt(2 / (n - 1)); a line through two levels
// is known as well as these.
TEST(FitPhotonTransfer, ExactPointsGiveTheLineAndItsStandardDeviations) {
  constexpr int kRepeats = 4;
  constexpr double kMean = 1000.0;
  const PhotonTransfer transfer = FitPhotonTransfer(PointsAt(0.0, kMean, kRepeats), true).value();

  EXPECT_NEAR(transfer.gain_dn_per_electron, kGain, 1e-12);
  EXPECT_NEAR(transfer.read_noise_dn, 2.0, 1e-9);
  EXPECT_NEAR(transfer.misfit, 0.0, 1e-9);
  const double relative = std::sqrt(2.0 / (kCount - 1.0) / (3.0 * kRepeats));
  const double dark_sd = relative * VarianceAt(0.0);
  const double gain_sd = std::hypot(dark_sd, relative * VarianceAt(kMean)) / kMean;
  EXPECT_NEAR(transfer.gain_sd, gain_sd, 1e-9 * gain_sd);
  EXPECT_NEAR(transfer.read_noise_sd, dark_sd / (2.0 * 2.0), 1e-9);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(transfer.gain_rgb[c], kGain, 1e-12);
    EXPECT_NEAR(transfer.gain_rgb_sd[c], std::sqrt(3.0) * gain_sd, 1e-9);
  }
}

TEST(FitPhotonTransfer, WeightsDoNotFollowTheNoiseOfVariances) {
  std::vector<TransferPoint> points = PointsAt(0.0, 1000.0, 4);
  for (size_t i = 0; i < points.size(); ++i) {
    points[i].variance_dn2 *=
        i / 6 % 2 == 0 ? 1.3 : 0.7;  // 1 on average, of every colour and level
  }
  const PhotonTransfer transfer = FitPhotonTransfer(points, true).value();
  EXPECT_NEAR(transfer.gain_dn_per_electron, kGain, 1e-9);
  // Each is off by 0.3 v, of a standard deviation of v sqrt(2 / 200).
  EXPECT_NEAR(transfer.misfit, 3.0, 1e-6);
}

TEST(FitPhotonTransfer, DarkPointsCountOnlyWhereAsked) {
  std::vector<TransferPoint> points = PointsAt(0.0, 1000.0, 4);
  const std::vector<TransferPoint> brighter = PointsAt(500.0, 2000.0, 4);
  points.insert(points.end(), brighter.begin(), brighter.end());
  for (TransferPoint& point : points) {
    point.variance_dn2 -= point.is_dark ? 3.0 : 0.0;  // cut off at black
  }
  EXPECT_NEAR(FitPhotonTransfer(points, false)->read_noise_dn, 2.0, 1e-6);
  EXPECT_LT(FitPhotonTransfer(points, true)->read_noise_dn, 1.2);
}

// One patch of four sites a colour, the frames' readings site by site.
ChartReadings ReadingsOf(const std::vector<std::pair<double, std::vector<uint16_t>>>& frames) {
  ChartReadings readings;
  readings.lights = {"led"};
  readings.patch_names = {"p"};
  readings.reflectance_rgb = {Eigen::Vector3d::Ones()};
  readings.patches = {
      {.colour = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2}, .block = std::vector<uint8_t>(12, 0)}};
  for (const auto& [exposure_s, dn] : frames) {
    readings.frames.push_back({.file = "f", .light = 0, .exposure_s = exposure_s, .dn = {dn}});
  }
  readings.frames.push_back(
      {.file = "dark", .exposure_s = 1.0, .dn = {std::vector<uint16_t>(12, 100)}});
  return readings;
}

std::vector<TransferPoint> PointsOf(const ChartReadings& readings, double highest_dn = 60000.0) {
  DarkLevel dark;
  return TransferPoints(readings, SamplesOf(readings, dark), highest_dn);
}

const std::vector<uint16_t> kA = {110, 120, 130, 140, 210, 220, 230, 240, 310, 320, 330, 340};

TEST(TransferPoints, PatternsAndBrightnessOfAPairCancel) {
  std::vector<uint16_t> b = kA;
  for (uint16_t& dn : b) {
    dn = static_cast<uint16_t>(dn + 7);
  }
  b[4] = static_cast<uint16_t>(b[4] + 2);  // the only noise: of green, +2, 0, 0, 0
  const std::vector<TransferPoint> points = PointsOf(ReadingsOf({{1.0, kA}, {1.0, b}}));
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points[0].variance_dn2, 0.0);
  EXPECT_NEAR(points[1].variance_dn2, 0.5 * (4.0 - 4.0 / 4.0) / 3.0, 1e-12);
  EXPECT_EQ(points[2].variance_dn2, 0.0);
  EXPECT_NEAR(points[0].mean_dn, 125.0 + 3.5 - 100.0, 1e-12);
  EXPECT_EQ(points[1].colour, 1U);
  EXPECT_EQ(points[1].count, 4.0);
}

TEST(TransferPoints, PairsAreOfOneExposureAndOfUnsaturatedSites) {
  // The first with the third, the second with the fourth; the fifth is left.
  const ChartReadings readings =
      ReadingsOf({{1.0, kA}, {2.0, kA}, {1.0, kA}, {2.0, kA}, {1.0, kA}});
  EXPECT_EQ(PointsOf(readings).size(), 6U);
  EXPECT_EQ(PointsOf(ReadingsOf({{1.0, kA}, {2.0, kA}})).size(), 0U);
  // Blue reaches 340 in either frame of a pair.
  std::vector<uint16_t> lower = kA;
  lower[11] = 330;
  for (const auto& pair : {std::pair{kA, lower}, std::pair{lower, kA}}) {
    EXPECT_EQ(PointsOf(ReadingsOf({{1.0, pair.first}, {1.0, pair.second}}), 335.0).size(), 2U);
  }
  EXPECT_EQ(PointsOf(ReadingsOf({{1.0, kA}, {1.0, lower}}), 341.0).size(), 3U);
}

}  // namespace
}  // namespace sateen::photon_transfer_test
