#include "cli/bench/bench_solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::bench_solve_test {
namespace {

using sateen::testing::RunResult;
using sateen::testing::TempFolder;

RunResult Bench(std::vector<std::string> words) {
  words.insert(words.begin(), {"solve", "--width", "64", "--height", "48", "--repeats", "1"});
  return sateen::testing::RunCommand<cli::BenchSolveArgs>(std::move(words), cli::AddBenchSolve,
                                                          cli::RunBenchSolve);
}

TEST(BenchSolve, PrintsTheFixedNamesAsJson) {
  const RunResult run = Bench({"--json", "--threads", "2"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  EXPECT_GT(json.at("floor_gb_per_s"), 0.0);
  std::set<std::string> seen;
  for (const nlohmann::json& row : json.at("rows")) {
    seen.insert(row.at("case").get<std::string>() + "/" + row.at("backend").get<std::string>() +
                "/" + std::to_string(row.at("threads").get<int>()));
    EXPECT_GT(row.at("ns_per_pixel"), 0.0);
    EXPECT_GT(row.at("times_jacobi_svd"), 0.0);
    EXPECT_GT(row.at("times_floor"), 0.0);
    EXPECT_TRUE(row.at("angular_error_deg").contains("p99"));
    if (row.at("case") == "clean") {
      EXPECT_LT(row.at("angular_error_deg").at("max"), 1e-3);
      EXPECT_LT(row.at("albedo_error"), 1e-5);
    }
  }
  EXPECT_EQ(seen.size(), 6U * 5U * 2U);  // cases, backends, numbers of threads
}

TEST(BenchSolve, DrawsThePlot) {
  const TempFolder folder;
  const std::filesystem::path plot = folder.Path() / "plot.svg";

  ASSERT_EQ(Bench({"--plot", plot.string(), "--threads", "1"}).exit_status, 0);

  EXPECT_GT(std::filesystem::file_size(plot), 1000U);
}

}  // namespace
}  // namespace sateen::bench_solve_test
