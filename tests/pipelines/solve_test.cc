#include "pipelines/solve/solve.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sateen::solve_pipeline_test {
namespace {

TEST(Passed, NoNumberIsNotWithinALimit) {
  SolveOptions options;
  Evaluation evaluation;
  EXPECT_TRUE(Passed(options, evaluation));
  options.fail_above_deg = 2.0;
  EXPECT_FALSE(Passed(options, evaluation));
  evaluation.angular_error_deg = ErrorStatistics{.count = 1, .mean = 2.0};
  EXPECT_TRUE(Passed(options, evaluation));
  evaluation.angular_error_deg->mean = std::nextafter(2.0, 3.0);
  EXPECT_FALSE(Passed(options, evaluation));
  evaluation.angular_error_deg->mean = std::nan("");
  EXPECT_FALSE(Passed(options, evaluation));
}

}  // namespace
}  // namespace sateen::solve_pipeline_test
