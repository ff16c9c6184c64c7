#include "calibration/response/linear_range.h"

#include <gtest/gtest.h>

namespace sateen::linear_range_test {
namespace {

constexpr double kTolerance = 0.01;

// Every 1000 DN from 1000 to 10000, exact, known to 0.05 %.
std::vector<LinearityBin> ExactBins() {
  std::vector<LinearityBin> bins;
  for (int i = 1; i <= 10; ++i) {
    bins.push_back({.level_dn = 1000.0 * i, .deviation = 0.0, .sd = 5e-4});
  }
  return bins;
}

LinearRange RangeOf(const std::vector<LinearityBin>& bins, double start_dn = 2500.0) {
  const auto range = FindLinearRange(bins, start_dn, kTolerance);
  EXPECT_TRUE(range);
  return range.value_or(LinearRange());
}

TEST(FindLinearRange, OfExactBinsIsAllOfThem) {
  const LinearRange range = RangeOf(ExactBins());
  EXPECT_EQ(range.from_dn, 1000.0);
  EXPECT_EQ(range.to_dn, 10000.0);
  EXPECT_FALSE(range.departs);
}

TEST(FindLinearRange, EndsWhereTheLineBetweenBinsLeavesTheTolerance) {
  for (const double sign : {1.0, -1.0}) {
    std::vector<LinearityBin> bins = ExactBins();
    bins[7].deviation = sign * 0.004;  // at 8000
    bins[8].deviation = sign * 0.016;  // at 9000: 1 % is half-way
    bins[9].deviation = sign * 0.05;
    const LinearRange range = RangeOf(bins);
    EXPECT_NEAR(range.to_dn, 8500.0, 1e-9);
    EXPECT_TRUE(range.departs);
  }
}

TEST(FindLinearRange, ANoisyBinEndsNoRange) {
  std::vector<LinearityBin> bins = ExactBins();
  bins[1] = {.level_dn = 2000.0, .deviation = 0.012, .sd = 0.004};
  bins[5] = {.level_dn = 6000.0, .deviation = -0.015, .sd = 0.004};  // 1 % + 1.25 sd
  LinearRange range = RangeOf(bins);
  EXPECT_EQ(range.from_dn, 1000.0);
  EXPECT_EQ(range.to_dn, 10000.0);
  EXPECT_FALSE(range.departs);
  // Three standard deviations beyond are no noise.
  bins[5].deviation = -0.022;
  range = RangeOf(bins);
  EXPECT_TRUE(range.departs);
  EXPECT_NEAR(range.to_dn, 5000.0 + 1000.0 * 10.0 / 22.0, 1e-9);
}

TEST(FindLinearRange, EndsAtTheLastBinWithinItNotAtTheOneThatProvesIt) {
  std::vector<LinearityBin> bins = ExactBins();
  bins[7] = {.level_dn = 8000.0, .deviation = 0.012, .sd = 0.002};  // off, if at all
  bins[8] = {.level_dn = 9000.0, .deviation = 0.030, .sd = 0.002};  // off for sure
  LinearRange range = RangeOf(bins);
  EXPECT_TRUE(range.departs);
  EXPECT_NEAR(range.to_dn, 7000.0 + 1000.0 * 10.0 / 12.0, 1e-9);
  bins[7].sd = 0.006;  // does not tell
  range = RangeOf(bins);
  EXPECT_TRUE(range.departs);
  EXPECT_NEAR(range.to_dn, 7000.0 + 2000.0 * 10.0 / 30.0, 1e-9);
  // The last certain bin counts if no brighter one is within the tolerance.
  bins = ExactBins();
  bins[9] = {.level_dn = 10000.0, .deviation = 0.0104, .sd = 4e-4};
  range = RangeOf(bins);
  EXPECT_TRUE(range.departs);
  EXPECT_NEAR(range.to_dn, 9000.0 + 1000.0 * 100.0 / 104.0, 1e-9);
}

TEST(FindLinearRange, WhatIsNotKnownToHalfTheToleranceTellsNothing) {
  std::vector<LinearityBin> bins = ExactBins();
  bins[0].sd = 0.006;
  bins[8].sd = 0.006;
  bins[9] = {.level_dn = 10000.0, .deviation = 0.012, .sd = 0.006};
  LinearRange range = RangeOf(bins);
  EXPECT_EQ(range.from_dn, 2000.0);
  EXPECT_EQ(range.to_dn, 8000.0);
  EXPECT_FALSE(range.departs);
  bins[2].sd = 0.006;  // the first above the start
  range = RangeOf(bins);
  EXPECT_EQ(range.from_dn, 2000.0);
  EXPECT_EQ(range.to_dn, 8000.0);
  for (LinearityBin& bin : bins) {
    bin.sd = 0.006;
  }
  EXPECT_FALSE(FindLinearRange(bins, 2500.0, kTolerance));
}

TEST(FindLinearRange, GoesDownToWhereTheToleranceIsLeft) {
  std::vector<LinearityBin> bins = ExactBins();
  bins[2].deviation = 0.02;  // at 3000; 1000 and 2000 are within it again
  const LinearRange range = RangeOf(bins, 3500.0);
  EXPECT_EQ(range.from_dn, 4000.0);
  EXPECT_EQ(range.to_dn, 10000.0);
  EXPECT_FALSE(FindLinearRange(bins, 10500.0, kTolerance));  // nothing above the start
}

}  // namespace
}  // namespace sateen::linear_range_test
