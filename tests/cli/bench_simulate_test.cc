#include "cli/bench/bench_simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::bench_simulate_test {
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
  EXPECT_LT(plain_deg, 0.5);  // the rest is the relief, which the solver takes for flat
  // Each of these is there: it moves the answer.
  for (const char* name :
       {"bounce_rays 64", "ambient_rgb 0.1", "flicker 0.2", "specular ggx 0.3", "psf_sigma_px 3",
        "shadows cast, 3 x 3", "bump from the 6th, 12 px", "sensor D5100, 9 stops under"}) {
    EXPECT_GT(error_deg.at(name), plain_deg + 0.005) << name;
  }
}

TEST(BenchSimulate, PrintsTables) {
  const RunResult run = Bench({});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.out, HasSubstr("Peak memory"));
  EXPECT_THAT(run.out, HasSubstr("bounce_rays 64"));
}

TEST(BenchSimulate, DrawsEverySwitch) {
  const sateen::testing::TempFolder folder;
  const RunResult run = Bench({"--pictures", (folder.Path() / "new/pictures").string()});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_TRUE(std::filesystem::exists(folder.Path() / "new/pictures/bounce.png"));
}

}  // namespace
}  // namespace sateen::bench_simulate_test
