#include "core/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sateen::statistics_test {
namespace {

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  EXPECT_EQ(Median(std::vector<double>{7.0}), 7.0);
  EXPECT_EQ(Median(std::vector<double>{9.0, 1.0, 4.0}), 4.0);
  EXPECT_EQ(Median(std::vector<double>{9.0, 1.0, 4.0, 2.0}), 4.0);
  EXPECT_EQ(Median(std::vector<float>{9.0F, 1.0F, 4.0F, 2.0F}), 4.0F);
}

TEST(Median, OfSizesGivesTheStandardDeviationOfNormalDeviates) {
  std::vector<double> sizes;
  for (int i = 0; i < 10000; ++i) {
    sizes.push_back(std::abs(2.5 * NormalQuantile((i + 0.5) / 10000.0)));
  }
  EXPECT_NEAR(kSdPerMad * Median(std::move(sizes)), 2.5, 1e-3);
}

TEST(Quantile, TakesTheOrderStatisticBelow) {
  const std::vector<double> values = {50.0, 10.0, 40.0, 20.0, 30.0};
  EXPECT_EQ(Quantile(values, 0.0), 10.0);
  EXPECT_EQ(Quantile(values, 0.24), 10.0);
  EXPECT_EQ(Quantile(values, 0.25), 20.0);
  EXPECT_EQ(Quantile(values, 0.5), 30.0);
  EXPECT_EQ(Quantile(values, 0.99), 40.0);
  EXPECT_EQ(Quantile(values, 1.0), 50.0);
  EXPECT_EQ(Quantile(std::vector<float>{2.0F, 1.0F}, 0.5), 1.0F);  // Median takes the upper one
}

TEST(InterpolatedQuantile, LiesBetweenItsNeighbours) {
  const std::vector<double> sorted = {1.0, 2.0, 4.0, 8.0};
  EXPECT_EQ(InterpolatedQuantile(sorted, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(InterpolatedQuantile(sorted, 0.5), 3.0);
  EXPECT_DOUBLE_EQ(InterpolatedQuantile(sorted, 0.9), 4.0 + 0.7 * 4.0);
  EXPECT_EQ(InterpolatedQuantile(sorted, 1.0), 8.0);
  EXPECT_EQ(InterpolatedQuantile(std::vector<double>{5.0}, 0.3), 5.0);
}

// Known values: Abramowitz and Stegun, tables 26.1, 26.5 and 26.8.
TEST(NormalQuantile, AgreesWithTables) {
  EXPECT_NEAR(NormalQuantile(0.5), 0.0, 1e-15);
  EXPECT_NEAR(NormalQuantile(0.975), 1.959963985, 1e-9);
  EXPECT_NEAR(NormalQuantile(0.999), 3.090232306, 1e-9);
  EXPECT_NEAR(NormalQuantile(1e-6), -4.753424309, 1e-9);
  EXPECT_NEAR(NormalQuantile(0.1), -NormalQuantile(0.9), 1e-14);
}

TEST(NormalQuantile, InvertsTheDistribution) {
  for (const double z : {-6.0, -2.2, -0.3, 0.0, 0.9, 4.1}) {
    const double share = 0.5 * std::erfc(-z / std::sqrt(2.0));
    EXPECT_NEAR(NormalQuantile(share), z, 1e-9 * std::max(1.0, std::abs(z))) << z;
  }
}

TEST(ChiSquaredQuantile, AgreesWithTables) {
  EXPECT_EQ(ChiSquaredQuantile(0.0, 4), 0.0);
  EXPECT_NEAR(ChiSquaredQuantile(0.95, 1), 3.841459, 1e-6);
  EXPECT_NEAR(ChiSquaredQuantile(0.95, 3), 7.814728, 1e-6);
  EXPECT_NEAR(ChiSquaredQuantile(0.05, 7), 2.167350, 1e-6);
  EXPECT_NEAR(ChiSquaredQuantile(0.999, 30), 59.70306, 1e-5);
  EXPECT_NEAR(ChiSquaredQuantile(0.005, 100), 67.32756, 1e-5);
}

TEST(ChiSquaredQuantile, IsExactOfOneAndTwoDegreesOfFreedom) {
  for (const double share : {0.01, 0.25, 0.5, 0.9, 0.9999}) {
    const double z = NormalQuantile(0.5 * (1.0 + share));
    EXPECT_NEAR(ChiSquaredQuantile(share, 1), z * z, 1e-10 * z * z) << share;
    EXPECT_NEAR(ChiSquaredQuantile(share, 2), -2.0 * std::log1p(-share), 1e-12) << share;
  }
}

TEST(StatisticsDeathTest, RefuseWhatHasNoAnswer) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_DEATH((void)Median(std::vector<double>()), "does not hold");
  EXPECT_DEATH((void)Quantile(std::vector<double>(), 0.5), "does not hold");
  EXPECT_DEATH((void)Quantile(std::vector<double>{1.0}, kNan), "does not hold");
  EXPECT_DEATH((void)InterpolatedQuantile({}, 0.5), "does not hold");
  EXPECT_DEATH((void)NormalQuantile(1.0), "does not hold");
  EXPECT_DEATH((void)ChiSquaredQuantile(0.5, 0), "does not hold");
}

}  // namespace
}  // namespace sateen::statistics_test
