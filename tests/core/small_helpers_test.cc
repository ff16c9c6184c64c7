#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <thread>

#include "core/angle.h"
#include "core/option_range.h"
#include "core/stopwatch.h"
#include "core/whole_number.h"

namespace sateen::small_helpers_test {
namespace {

TEST(AngleBetweenRad, IsThatOfTheDirectionsWhateverTheLengths) {
  const Eigen::Vector3d x(3.0, 0.0, 0.0);
  EXPECT_NEAR(AngleBetweenRad(x, Eigen::Vector3d(0.0, 0.1, 0.0)), 90.0 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(AngleBetweenRad(x, Eigen::Vector3d(1.0, 0.0, -1.0)), 45.0 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(AngleBetweenRad(x, -x), 180.0 * kRadPerDeg, 1e-15);
  EXPECT_EQ(AngleBetweenRad(x, x), 0.0);
}

TEST(AngleBetweenRad, IsExactForSmallAngles) {
  const Eigen::Vector3d a(0.0, 0.0, 1.0);
  for (const double angle : {1e-3, 1e-9, 1e-15}) {
    const Eigen::Vector3d b(std::sin(angle), 0.0, std::cos(angle));
    EXPECT_NEAR(AngleBetweenRad(a, b) / angle, 1.0, 1e-12) << angle;
  }
  EXPECT_NEAR(AngleBetweenRad(Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(1e-6F, 0, 1)), 1e-6, 1e-13);
}

TEST(ClampedTo, DropsTheFractionAndStaysInTheType) {
  using IntLimits = std::numeric_limits<int>;
  EXPECT_EQ(ClampedTo<int>(2.9), 2);
  EXPECT_EQ(ClampedTo<int>(-2.9), -2);
  EXPECT_EQ(ClampedTo<int>(2147483646.5), 2147483646);
  for (const double huge : {2147483647.0, 2147483648.0, 1e30, 1e308, HUGE_VAL}) {
    EXPECT_EQ(ClampedTo<int>(huge), IntLimits::max());
    EXPECT_EQ(ClampedTo<int>(-huge - 1.0), IntLimits::min());
  }
  EXPECT_EQ(ClampedTo<int>(std::nan("")), 0);
  EXPECT_EQ(ClampedTo<unsigned>(-1.0), 0U);
  EXPECT_EQ(ClampedTo<std::uint16_t>(70'000.0), 65535);
  EXPECT_EQ(ClampedTo<std::int64_t>(9223372036854775808.0),
            std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(ClampedTo<std::uint64_t>(18446744073709551616.0),
            std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(ClampedTo<std::int64_t>(-9.3e18), std::numeric_limits<std::int64_t>::min());
}

TEST(Stopwatch, CountsSecondsUpwards) {
  const auto before = std::chrono::steady_clock::now();
  const Stopwatch watch;
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const double first_s = watch.Seconds();
  const double second_s = watch.Seconds();
  const std::chrono::duration<double> outside = std::chrono::steady_clock::now() - before;
  EXPECT_GE(first_s, 0.02);
  EXPECT_GE(second_s, first_s);
  EXPECT_LE(second_s, outside.count());
}

TEST(CheckRange, NamesTheOptionItsValueAndItsRange) {
  const auto message = [](double value) {
    const Status status = CheckRange("alpha", value, 0.001, 1.0);
    if (!status) {
      EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    }
    return status ? "" : status.error().message;
  };
  EXPECT_EQ(message(0.001), "");
  EXPECT_EQ(message(1.0), "");
  EXPECT_EQ(message(-1.0), "alpha = -1; need 0.001 to 1");
  EXPECT_EQ(message(1.25), "alpha = 1.25; need 0.001 to 1");
  EXPECT_EQ(message(std::numeric_limits<double>::quiet_NaN()), "alpha = nan; need 0.001 to 1");
}

TEST(OutOfRange, SaysWhatIsNeeded) {
  const Status status = OutOfRange("fill", 0.0, "0 < fill <= 1");
  EXPECT_EQ(status.error().message, "fill = 0; need 0 < fill <= 1");
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace sateen::small_helpers_test
