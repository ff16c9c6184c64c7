#include "cli/bench_simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/cli/cli_runner.h"

namespace sateen {
namespace {

using sateen::testing::RunResult;
using ::testing::HasSubstr;

RunResult Bench(std::vector<std::string> words) {
  words.insert(words.begin(),
               {"simulate", "--width", "64", "--height", "48", "--switch-width", "64"});
  return sateen::testing::RunCommand<cli::BenchSimulateArgs>(
      std::move(words), cli::AddBenchSimulate, cli::RunBenchSimulate);
}

TEST(BenchSimulate, MeasuresEveryStepAndEverySwitch) {
  const RunResult run = Bench({"--json", "--threads", "2"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  EXPECT_EQ(json.at("schema"), "sateen.bench.simulate/1");
  EXPECT_EQ(json.at("frames"), 11);
  EXPECT_GT(json.at("peak_memory_gb"), 0.0);
  double seconds = 0.0;
  for (const nlohmann::json& step : json.at("steps")) {
    EXPECT_GT(step.at("seconds"), 0.0) << step;
    seconds += step.at("seconds").get<double>();
  }
  EXPECT_EQ(json.at("steps").size(), 4U);
  EXPECT_NEAR(json.at("seconds"), seconds, 1e-9);
  std::map<std::string, double> error_deg;
  for (const nlohmann::json& one : json.at("switches")) {
    EXPECT_GT(one.at("times_plain"), 0.0) << one;
    error_deg[one.at("switch")] = one.at("mean_angular_error_deg");
  }
  const double plain_deg = error_deg.at("plain: near lights, Lambert");
  EXPECT_LT(plain_deg, 0.3);  // what is left is the relief, which the solver takes for flat
  // Each of these is there: it moves the answer.
  for (const char* name : {"bounce_rays: 16", "ambient_rgb: 0.02", "flicker: 0.01",
                           "specular: ggx, alpha 0.3", "psf_sigma_px: 1"}) {
    EXPECT_GT(error_deg.at(name), plain_deg + 0.005) << name;
  }
}

TEST(BenchSimulate, PrintsTables) {
  const RunResult run = Bench({});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.out, HasSubstr("Peak memory"));
  EXPECT_THAT(run.out, HasSubstr("bounce_rays: 16"));
}

}  // namespace
}  // namespace sateen
