#include "pipelines/calibrate/predicted_errors.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sateen::predicted_errors_test {
namespace {

using ::testing::HasSubstr;

TEST(PredictedErrors, AreThoseOfAHundredRigs) {
  for (const int tilts : {0, 4}) {
    const ErrorRatios ratios = PredictedErrors({.columns = 24, .rows = 16, .tilts = tilts}).value();

    fmt::print(
        "flat and {} tilts, {} rigs: actual over predicted: position {:.2f} {:.2f} {:.2f}, "
        "flux {:.2f} {:.2f} {:.2f}, direction {:.2f}\n",
        tilts, ratios.rigs, ratios.position[0], ratios.position[1], ratios.position[2],
        ratios.flux[0], ratios.flux[1], ratios.flux[2], ratios.direction);
    EXPECT_EQ(ratios.rigs, 100);
    for (Eigen::Index c = 0; c < 3; ++c) {
      EXPECT_NEAR(ratios.position[c], 1.05, 0.35) << c;  // the 0.7 to 1.4
      EXPECT_NEAR(ratios.flux[c], 1.05, 0.35) << c;
    }
    EXPECT_NEAR(ratios.direction, 1.05, 0.35);
  }
}

TEST(PredictedErrors, OptionsAreChecked) {
  EXPECT_THAT(PredictedErrors({.rigs = 2}).error().message, HasSubstr("rigs = 2"));
}

}  // namespace
}  // namespace sateen::predicted_errors_test
