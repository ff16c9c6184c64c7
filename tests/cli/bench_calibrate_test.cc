#include "cli/bench/bench_calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/cli_runner.h"

namespace sateen::bench_calibrate_test {
namespace {

using sateen::testing::RunResult;
using ::testing::HasSubstr;

// The whole chain, small: sheets, calibration, fabric. The table at full size is in
// docs/calibration.md.
TEST(BenchCalibrate, MeasuresTheWholeChain) {
  const RunResult run = sateen::testing::RunCommand<cli::BenchCalibrateArgs>(
      {"calibrate", "--width", "480", "--height", "320", "--rigs", "10", "--json"},
      cli::AddBenchCalibrate, cli::RunBenchCalibrate);

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  EXPECT_EQ(json.at("schema"), "sateen.bench.calibrate/1");
  ASSERT_EQ(json.at("rows").size(), 2U);
  for (const nlohmann::json& row : json.at("rows")) {
    EXPECT_LT(row.at("direction_deg"), 0.25) << row;
    EXPECT_GT(row.at("flat_deg"), 0.0) << row;
    EXPECT_GT(row.at("seconds"), 0.0) << row;
    EXPECT_GT(row.at("peak_memory_gb"), 0.0) << row;
  }
  EXPECT_LT(json.at("rows")[1].at("position_mm"), json.at("rows")[0].at("position_mm"));
  EXPECT_EQ(json.at("raw_frames"), 55);
  // At 0.6 mm per pixel demosaicing a twill of 1.6 mm is wrong by more than any of these lights,
  // with the true ones too; what the calibration adds to that must not be seen.
  ASSERT_EQ(json.at("fabric").size(), 4U);
  const double truth_deg = json.at("fabric")[0].at("low_frequency_deg");
  EXPECT_NEAR(json.at("fabric")[1].at("low_frequency_deg"), truth_deg, 0.02);
  EXPECT_GT(json.at("fabric")[3].at("low_frequency_deg"), truth_deg + 0.2);
  EXPECT_EQ(json.at("predicted").size(), 2U);
}

}  // namespace
}  // namespace sateen::bench_calibrate_test
