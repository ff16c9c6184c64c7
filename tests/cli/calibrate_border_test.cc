#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "cli/calibrate/calibrate_check.h"
#include "cli/calibrate/calibrate_lights.h"
#include "rig/rig.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::calibrate_border_test {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

constexpr const char* kBorder = "sheet:190x142mm:9mm";

const fs::path& Samples() {
  static const fs::path samples = fs::path(testing::SourceDir()) / "samples";
  return samples;
}

nlohmann::json ReadJson(const fs::path& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

// Sheets with a marker border whose poses no session records, and lights 15 mm off.
class CalibrateBorder : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    for (const char* sheet : {"flat", "tilt-1", "tilt-2", "tilt-3", "tilt-4"}) {
      const fs::path scene = Samples() / "scenes" / fmt::format("border-{}.json", sheet);
      const RunResult run = Simulate({scene.string(), "-o", Path(sheet)});
      ASSERT_EQ(run.exit_status, 0) << run.log;
    }
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return (folder_->Path() / name).string(); }

  static RunResult Calibrate(const std::vector<std::string>& sheets,
                             const std::vector<std::string>& more) {
    std::vector<std::string> words = {"lights", "--rig",
                                      (Samples() / "rigs" / "ring10-rough.json").string(), "-o",
                                      Path("rig.json")};
    for (const std::string& sheet : sheets) {
      words.insert(words.end(), {"--sheet", Path(sheet)});
    }
    words.insert(words.end(), more.begin(), more.end());
    fs::remove(Path("rig.json"));
    return sateen::testing::RunCommand<cli::CalibrateLightsArgs>(
        std::move(words), cli::AddCalibrateLights, cli::RunCalibrateLights);
  }

  // A copy of a sheet's session whose frame of a light is that of another session.
  static void Mix(const std::string& name, const std::string& sheet, const std::string& other) {
    fs::copy(Path(sheet), Path(name), fs::copy_options::recursive);
    fs::copy_file(Path(other + "/frames/led-3.dng"), Path(name + "/frames/led-3.dng"),
                  fs::copy_options::overwrite_existing);
    nlohmann::json session = ReadJson(Path(name + "/session.json"));
    session["frames"][3].erase("sha256");
    WriteText(Path(name + "/session.json"), session.dump());
  }

  static TempFolder* folder_;
};

TempFolder* CalibrateBorder::folder_ = nullptr;

// The bars of a flat sheet and four tilts whose poses come from the border.
TEST_F(CalibrateBorder, PosesFromTheBorderGiveLightsWithinTheBars) {
  EXPECT_FALSE(ReadJson(Path("tilt-1/session.json")).contains("table_from_sheet"));

  const RunResult run =
      Calibrate({"flat", "tilt-1", "tilt-2", "tilt-3", "tilt-4"}, {"--border", kBorder, "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  ASSERT_EQ(json.at("sheets").size(), 5U);
  double tilt_deg = 0.0;
  for (const nlohmann::json& sheet : json.at("sheets")) {
    tilt_deg = std::max(tilt_deg, sheet.at("tilt_error_deg").get<double>());
    EXPECT_LT(sheet.at("tilt_error_deg"), 0.01) << sheet;  // a quarter of what lights may be off
    EXPECT_LT(sheet.at("position_error_mm"), 0.05) << sheet;
    EXPECT_GE(sheet.at("markers"), 40) << sheet;
  }
  ASSERT_EQ(json.at("lights").size(), 10U);
  double position_mm = 0.0;
  double direction_deg = 0.0;
  double flux = 0.0;
  for (const nlohmann::json& light : json.at("lights")) {
    position_mm = std::max(position_mm, light.at("position_error_mm").get<double>());
    direction_deg = std::max(direction_deg, light.at("direction_error_deg").get<double>());
    flux = std::max(flux, light.at("flux_error").get<double>());
    EXPECT_NEAR(light.at("moved_mm"), 15.0, 1.0);
  }
  fmt::print(
      "five sheets, poses from the border: tilts to {:.4f} deg; lights: position {:.3f} mm, "
      "direction {:.4f} deg, flux {:.3f} %\n",
      tilt_deg, position_mm, direction_deg, 100.0 * flux);
  EXPECT_LE(position_mm, 0.4);
  EXPECT_LE(direction_deg, 0.04);
  EXPECT_LE(flux, 0.003);
}

TEST_F(CalibrateBorder, ASheetWithoutAPoseIsWarnedOf) {
  const RunResult run = Calibrate({"flat", "flat"}, {"--model", "near"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("flat: its pose is neither recorded nor found"));
}

// A recorded pose counts, unless the border is asked for; either way print is left out.
TEST_F(CalibrateBorder, RecordedPosesComeFirst) {
  fs::copy(Path("flat"), Path("recorded"), fs::copy_options::recursive);
  nlohmann::json session = ReadJson(Path("recorded/session.json"));
  session["table_from_sheet"] = ReadJson(Path("recorded/truth/pose.json"))["table_from_target"];
  WriteText(Path("recorded/session.json"), session.dump());

  const RunResult recorded = Calibrate({"recorded"}, {"--border", kBorder, "--json"});
  ASSERT_EQ(recorded.exit_status, 0) << recorded.log;
  EXPECT_EQ(recorded.Json().at("sheets").size(), 0U);
  const RunResult with_print = Calibrate({"recorded"}, {"--json"});
  ASSERT_EQ(with_print.exit_status, 0) << with_print.log;
  const nlohmann::json lights = recorded.Json().at("lights");
  const nlohmann::json print_lights = with_print.Json().at("lights");
  ASSERT_EQ(lights.size(), 10U);
  for (size_t k = 0; k < lights.size(); ++k) {
    // Beyond four standard deviations lies one sample in 5,000, of all three colours.
    EXPECT_LE(lights[k].at("samples_left_out"), 6) << lights[k];
    EXPECT_GT(print_lights[k].at("samples_left_out"), 1000) << print_lights[k];
  }
  const RunResult found = Calibrate({"recorded"}, {"--border", kBorder, "--find-poses", "--json"});
  ASSERT_EQ(found.exit_status, 0) << found.log;
  EXPECT_EQ(found.Json().at("sheets").size(), 1U);
}

// The rig that the sheets gave, checked on one of them: print is no fault where the border is
// named.
TEST_F(CalibrateBorder, ACheckLeavesThePrintOut) {
  ASSERT_EQ(Calibrate({"flat", "tilt-1", "tilt-3"}, {"--border", kBorder}).exit_status, 0);
  const auto check = [](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"check", "--rig", Path("rig.json"), "--sheet",
                                      Path("tilt-1")};
    words.insert(words.end(), more.begin(), more.end());
    return sateen::testing::RunCommand<cli::CalibrateCheckArgs>(
        std::move(words), cli::AddCalibrateCheck, cli::RunCalibrateCheck);
  };
  const RunResult bordered = check({"--border", kBorder});
  EXPECT_EQ(bordered.exit_status, 0) << bordered.out << bordered.log;
  EXPECT_EQ(check({}).exit_status, 3);
  EXPECT_EQ(check({"--border", "sheet:A4"}).exit_status, 2);
}

// A fold along y, 0.6 mm deep and 4.5 mm wide.
TEST_F(CalibrateBorder, AFoldAcrossASheetIsNamedWithItsPlace) {
  WriteText(Path("fold.json"),
            fmt::format(R"({{"schema": "sateen.scene/1", "rig": "{}/rigs/ring10.json", "seed": 3,
                "surface": {{"shape": "groove", "depth_mm": 0.6, "opening_deg": 150}},
                "materials": {{"surface": {{"albedo": [0.99, 0.99, 0.99]}}}},
                "sensor": {{"preset": "nikon-d5100", "black": 600, "full_scale": 1.5}}}})",
                        Samples().string()));
  ASSERT_EQ(Simulate({Path("fold.json"), "-o", Path("fold")}).exit_status, 0);
  nlohmann::json session = ReadJson(Path("fold/session.json"));
  session["kind"] = "sheet";
  WriteText(Path("fold/session.json"), session.dump());

  const RunResult run = Calibrate({"fold"}, {});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("fold: "));
  EXPECT_THAT(run.log,
              HasSubstr("of the sheet does not follow the lights, most of all under 'led-"));
  EXPECT_THAT(run.log, HasSubstr("mm long and 4 mm wide about x = 1, y = 0 mm: is it a fold?"));
}

TEST_F(CalibrateBorder, WhatIsWrongWithABorderIsNamedAndNothingIsWritten) {
  const auto log_of = [&](const std::string& sheet, const std::string& border) {
    const RunResult run = Calibrate({sheet}, {"--border", border});
    EXPECT_EQ(run.exit_status, 3) << run.log;
    EXPECT_FALSE(fs::exists(Path("rig.json")));
    return run.log;
  };
  EXPECT_THAT(log_of("flat", "sheet:A4:12mm"), HasSubstr("flat: "));
  EXPECT_THAT(log_of("flat", "sheet:A4:12mm"), HasSubstr("it is another sheet"));
  EXPECT_THAT(log_of("flat", "sheet:190x142mm:9mm:DICT_7X7_50"),
              HasSubstr("0 markers of the border 'sheet:190x142mm:9mm:DICT_7X7_50' found"));
  Mix("mixed", "flat", "tilt-2");
  EXPECT_THAT(log_of("mixed", kBorder),
              HasSubstr("mixed: frames/led-3.dng does not show the border "
                        "where the other frames do"));
  const RunResult bad = Calibrate({"flat"}, {"--border", "sheet:A9:12mm"});
  EXPECT_EQ(bad.exit_status, 2);
  EXPECT_THAT(bad.log, HasSubstr("paper 'A9'; need A4"));
  EXPECT_EQ(Calibrate({"flat"}, {"--find-poses"}).exit_status, 2);
}

}  // namespace
}  // namespace sateen::calibrate_border_test
