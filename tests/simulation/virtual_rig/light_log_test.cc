#include "simulation/virtual_rig/board/light_log.h"

#include <gmock/gmock.h>

#include <cmath>
#include <thread>

namespace sateen::testing::light_log_test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;

const LightLog::Time kStart = LightLog::Time(hours(1));
LightLog::Time After(milliseconds time) { return kStart + time; }

// Returns the mean of light 0 between times after kStart; all is known.
double Mean(LightLog& log, milliseconds begin, milliseconds end) {
  log.KnownUntil(After(hours(2)));
  const auto means = log.MeanLevels(After(begin), After(end));
  EXPECT_TRUE(means) << means.error().message;
  return means ? means->at(0) : -1.0;
}

TEST(LightLog, ALightThatIsOnThroughoutHasExactlyItsLevel) {
  LightLog log(2, milliseconds(1));
  log.Changed(After(milliseconds(0)), 0, 1.0);
  EXPECT_EQ(Mean(log, milliseconds(30), milliseconds(50)), 1.0);
  EXPECT_EQ(Mean(log, milliseconds(37), milliseconds(60)), 1.0);
  EXPECT_EQ(log.MeanLevels(After(milliseconds(30)), After(milliseconds(50)))->at(1), 0.0);
  log.Changed(After(milliseconds(100)), 0, 0.5);
  EXPECT_EQ(Mean(log, milliseconds(150), milliseconds(190)), 0.5);
  log.Changed(After(milliseconds(200)), 0, 0.0);
  EXPECT_EQ(Mean(log, milliseconds(220), milliseconds(240)), 0.0);
}

TEST(LightLog, AShareOfTheTimeIsThatShareOfTheLevel) {
  LightLog log(1);
  log.Changed(After(milliseconds(10)), 0, 0.8);
  log.Changed(After(milliseconds(15)), 0, 0.4);
  log.Changed(After(milliseconds(30)), 0, 0.0);
  EXPECT_NEAR(Mean(log, milliseconds(0), milliseconds(20)), (5 * 0.8 + 5 * 0.4) / 20, 1e-12);
  EXPECT_NEAR(Mean(log, milliseconds(12), milliseconds(14)), 0.8, 1e-12);
  EXPECT_NEAR(Mean(log, milliseconds(25), milliseconds(45)), 5 * 0.4 / 20, 1e-12);
  EXPECT_EQ(Mean(log, milliseconds(0), milliseconds(10)), 0.0);
  // An exposure of no length sees what is there.
  EXPECT_EQ(Mean(log, milliseconds(12), milliseconds(12)), 0.8);
}

TEST(LightLog, RiseAndFallFollowTheClosedForm) {
  constexpr double kTauMs = 2.0;
  LightLog log(1, milliseconds(2));
  log.Changed(After(milliseconds(0)), 0, 1.0);
  // r = 1 - exp(-t / tau): its mean over [3, 8] ms.
  const double rise =
      1.0 - kTauMs * (std::exp(-3.0 / kTauMs) - std::exp(-8.0 / kTauMs)) / (8.0 - 3.0);
  EXPECT_NEAR(Mean(log, milliseconds(3), milliseconds(8)), rise, 1e-9);
  // On at 0 and off at 4 ms, long before it has risen; from 4 ms on r = r(4) exp(-(t - 4) / tau).
  log.Changed(After(milliseconds(4)), 0, 0.0);
  const double r4 = 1.0 - std::exp(-4.0 / kTauMs);
  const double fall =
      r4 * kTauMs * (std::exp(-1.0 / kTauMs) - std::exp(-5.0 / kTauMs)) / (9.0 - 5.0);
  EXPECT_NEAR(Mean(log, milliseconds(5), milliseconds(9)), fall, 1e-9);
  // From before it goes on to long after it is off, the light is all that it was told.
  EXPECT_NEAR(Mean(log, milliseconds(-10), milliseconds(90)), 4.0 / 100.0, 1e-12);
}

TEST(LightLog, AnExposureWaitsUntilAllOfItIsKnown) {
  LightLog log(1);
  log.KnownUntil(After(milliseconds(10)));
  const auto unknown = log.MeanLevels(After(milliseconds(0)), After(milliseconds(20)),
                                      /*longest=*/milliseconds(1));
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kTimeout);
  std::thread board([&log] {
    log.Changed(After(milliseconds(15)), 0, 1.0);
    log.KnownUntil(After(milliseconds(20)));
  });
  const auto means = log.MeanLevels(After(milliseconds(0)), After(milliseconds(20)));
  board.join();
  ASSERT_TRUE(means);
  EXPECT_NEAR(means->at(0), 0.25, 1e-12);
}

TEST(LightLog, NobodyWaitsForALogThatIsClosed) {
  LightLog log(1);
  std::thread board([&log] { log.Close(); });
  const auto means = log.MeanLevels(After(milliseconds(0)), After(milliseconds(20)));
  board.join();
  ASSERT_FALSE(means);
  EXPECT_EQ(means.error().code, ErrorCode::kCancelled);
}

TEST(LightLog, WhatIsOldIsForgottenAndWhatIsNewIsNot) {
  LightLog log(1, milliseconds(1));
  for (int k = 0; k < 100; ++k) {
    log.Changed(kStart + hours(k), 0, k % 2 == 0 ? 1.0 : 0.25);
  }
  log.KnownUntil(kStart + hours(200));
  EXPECT_EQ(log.MeanLevels(kStart + hours(98), kStart + hours(99))->at(0), 1.0);
  EXPECT_EQ(log.MeanLevels(kStart + hours(100), kStart + hours(101))->at(0), 0.25);
}

}  // namespace
}  // namespace sateen::testing::light_log_test
