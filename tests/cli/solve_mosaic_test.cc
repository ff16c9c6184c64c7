#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "cli/solve.h"
#include "tests/cli/cli_runner.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::solve_mosaic_test {
namespace {

namespace fs = std::filesystem;

using sateen::testing::ReadBytes;
using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::Solve;
using sateen::testing::TempFolder;
using ::testing::HasSubstr;

// A session of camera RAW frames of a woven cloth, with truth; rendered once.
class SolveMosaic : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    const fs::path scene = fs::path(testing::SourceDir()) / "samples/scenes/twill-small.json";
    const RunResult run = Simulate({scene.string(), "-o", Path("session")});
    ASSERT_EQ(run.exit_status, 0) << run.log;
    fs::copy(Path("session"), Path("without-truth"), fs::copy_options::recursive);
    fs::remove_all(Path("without-truth/truth"));
  }
  static void TearDownTestSuite() { delete folder_; }

  [[nodiscard]] static std::string Path(const std::string& name) {
    return (folder_->Path() / name).string();
  }

 private:
  static TempFolder* folder_;
};

TempFolder* SolveMosaic::folder_ = nullptr;

// Colours that are interpolated across the edges of yarns before the solve bend the normals there.
TEST_F(SolveMosaic, IsTheDefaultForRawFramesAndTruerOnAWeave) {
  const RunResult raw = Solve({Path("session"), "-o", Path("raw"), "--json"});
  const RunResult rgb = Solve({Path("session"), "-o", Path("rgb"), "--json", "--domain", "rgb"});
  ASSERT_EQ(raw.exit_status, 0) << raw.log;
  ASSERT_EQ(rgb.exit_status, 0) << rgb.log;
  EXPECT_EQ(raw.Json().at("domain"), "raw");
  EXPECT_EQ(rgb.Json().at("domain"), "rgb");
  const double raw_deg = raw.Json().at("angular_error_deg").at("mean");
  const double rgb_deg = rgb.Json().at("angular_error_deg").at("mean");
  EXPECT_LT(raw_deg, 0.6 * rgb_deg);
  EXPECT_LT(raw_deg, 1.0);
}

TEST_F(SolveMosaic, BandByBandItWritesTheMapsOfTheWhole) {
  const RunResult whole = Solve({Path("session"), "-o", Path("whole")});
  const RunResult bands = Solve({Path("without-truth"), "-o", Path("bands"), "--json"});
  ASSERT_EQ(whole.exit_status, 0) << whole.log;
  ASSERT_EQ(bands.exit_status, 0) << bands.log;
  EXPECT_EQ(bands.Json().at("domain"), "raw");
  EXPECT_EQ(bands.Json().at("solved"), bands.Json().at("pixels"));
  for (const char* name : {"normal.exr", "normal.png", "albedo.exr", "residual.exr", "samples.png",
                           "reason.png", "uncertainty.exr", "model.png"}) {
    EXPECT_EQ(ReadBytes(Path(std::string("whole/") + name)),
              ReadBytes(Path(std::string("bands/") + name)))
        << name;
  }
  EXPECT_TRUE(fs::exists(Path("bands/overview.png")));
  EXPECT_FALSE(fs::exists(Path("bands/error.exr")));
}

TEST_F(SolveMosaic, WithoutTheLadderItLeavesNoMapsOfOne) {
  ASSERT_EQ(Solve({Path("without-truth"), "-o", Path("plain")}).exit_status, 0);
  const RunResult run =
      Solve({Path("without-truth"), "-o", Path("plain"), "--robust", "none", "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_EQ(run.Json().at("domain"), "raw");
  EXPECT_FALSE(fs::exists(Path("plain/uncertainty.exr")));
  EXPECT_FALSE(fs::exists(Path("plain/model.png")));
}

TEST_F(SolveMosaic, ByTheReferenceItIsTheSame) {
  const RunResult fast = Solve({Path("session"), "-o", Path("fast"), "--json"});
  const RunResult reference =
      Solve({Path("session"), "-o", Path("svd"), "--json", "--backend", "jacobi-svd"});
  ASSERT_EQ(reference.exit_status, 0) << reference.log;
  EXPECT_EQ(reference.Json().at("domain"), "raw");
  EXPECT_NEAR(reference.Json().at("angular_error_deg").at("mean").get<double>(),
              fast.Json().at("angular_error_deg").at("mean").get<double>(), 1e-4);
  const RunResult other =
      Solve({Path("session"), "-o", Path("qr"), "--backend", "qr", "--domain", "raw"});
  EXPECT_NE(other.exit_status, 0);
  EXPECT_THAT(other.log, HasSubstr("--backend qr"));
}

TEST_F(SolveMosaic, WhatHasNoMosaicsIsSolvedFromColoursOrRefused) {
  const fs::path scene = fs::path(testing::SourceDir()) / "samples/scenes/twill-small.json";
  ASSERT_EQ(Simulate({scene.string(), "-o", Path("linear"), "--linear"}).exit_status, 0);
  const RunResult by_default = Solve({Path("linear"), "-o", Path("linear-maps"), "--json"});
  ASSERT_EQ(by_default.exit_status, 0) << by_default.log;
  EXPECT_EQ(by_default.Json().at("domain"), "rgb");
  EXPECT_THAT(by_default.Json().at("why_rgb").get<std::string>(), HasSubstr("not camera RAW"));
  const RunResult refused = Solve({Path("linear"), "-o", Path("refused"), "--domain", "raw"});
  EXPECT_EQ(refused.exit_status, 3);
  EXPECT_THAT(refused.log, HasSubstr("cannot be solved from the mosaics"));
  EXPECT_FALSE(fs::exists(Path("refused")));
}

}  // namespace
}  // namespace sateen::solve_mosaic_test
