#include "cli/bench/bench_accuracy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/cli_runner.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::bench_accuracy_test {
namespace {

using sateen::testing::ReadBytes;
using sateen::testing::RunResult;
using sateen::testing::TempFolder;
using ::testing::HasSubstr;

RunResult BenchAccuracy(std::vector<std::string> words) {
  words.insert(words.begin(), "accuracy");
  return sateen::testing::RunCommand<cli::BenchAccuracyArgs>(
      std::move(words), cli::AddBenchAccuracy, cli::RunBenchAccuracy);
}

const nlohmann::json& RowOf(const nlohmann::json& report, const std::string& method,
                            const std::string& data) {
  for (const nlohmann::json& row : report.at("rows")) {
    if (row.at("method") == method && row.at("data") == data) {
      return row;
    }
  }
  static const nlohmann::json kNone;
  return kNone;
}

TEST(BenchAccuracy, AFolderThatIsNotThereIsAUsageError) {
  EXPECT_EQ(BenchAccuracy({"--data", "/nonexistent"}).exit_status, 2);
}

TEST(BenchAccuracy, ComparesColoursWithMosaicsAndWritesThePage) {
  const TempFolder folder;
  const std::string page = (folder.Path() / "accuracy.md").string();
  const std::string plot = (folder.Path() / "images-accuracy.svg").string();
  const RunResult run =
      BenchAccuracy({"--data", folder.Path().string(), "--scene",
                     testing::SourceDir() + "/samples/scenes/twill-small.json", "--repeats", "1",
                     "--json", "--markdown", page, "--plot", plot});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json report = run.Json();
  EXPECT_EQ(report.at("skipped").size(), 5U);
  const nlohmann::json& colours = RowOf(report, "ladder", "twill-small");
  const nlohmann::json& mosaics = RowOf(report, "ladder, mosaics", "twill-small");
  EXPECT_LT(mosaics.at("mean_deg").get<double>(), colours.at("mean_deg").get<double>());
  // The predicted error of a Lambertian surface is its actual error.
  const nlohmann::json& relief = RowOf(report, "ladder", "Lambertian relief");
  EXPECT_NEAR(relief.at("standardised_error").get<double>(), 1.0, 0.1);
  EXPECT_NEAR(relief.at("coverage").get<double>(), 0.975, 0.02);
  EXPECT_GT(relief.at("megapixels_per_s").get<double>(), 0.0);
  EXPECT_THAT(ReadBytes(page), HasSubstr("## twill-small"));
  EXPECT_THAT(ReadBytes(page), HasSubstr("](images-accuracy.svg)"));
  EXPECT_THAT(ReadBytes(plot), HasSubstr("twill-small"));
}

}  // namespace
}  // namespace sateen::bench_accuracy_test
