#include "cli/calibrate/calibrate_lights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "calibration/sheet/flatness.h"
#include "core/angle.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "scanner/sessions/sheet_reader.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::calibrate_lights_test {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

RunResult CalibrateLights(std::vector<std::string> words) {
  words.insert(words.begin(), "lights");
  return sateen::testing::RunCommand<cli::CalibrateLightsArgs>(
      std::move(words), cli::AddCalibrateLights, cli::RunCalibrateLights);
}

// Sheets of white paper as a 14-bit camera of 480 x 360 pixels sees them, and a rough rig whose
// lights are 15 mm off, all rendered once.
class CalibrateLightsCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    std::ifstream sample(fs::path(testing::SourceDir()) / "samples" / "rigs" / "ring10.json");
    nlohmann::json rig = nlohmann::json::parse(sample);
    rig["camera"]["size_px"] = {480, 360};
    rig["camera"]["k"] = {1464.0, 1464.0, 239.5, 179.5};
    WriteText(folder_->Path() / "true.json", rig.dump());
    size_t axis = 0;
    for (nlohmann::json& light : rig["lights"]) {
      nlohmann::json& coordinate = light["position_mm"][axis++ % 3];
      coordinate = coordinate.get<double>() + 15.0;
      light["flux_rgb"] = {1, 1, 1};
    }
    WriteText(folder_->Path() / "rough.json", rig.dump());
    Render("flat", 0, 0, 1, R"("albedo": [0.99, 0.99, 0.99])");
    for (int tilt = 0; tilt < 4; ++tilt) {
      Render("tilt-" + std::to_string(tilt), 10, 90 * tilt, 2 + tilt,
             R"("albedo": [0.99, 0.99, 0.99])");
    }
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static void Render(const std::string& name, int slope_deg, int azimuth_deg, int seed,
                     const std::string& material, double full_scale = 1.5,
                     const std::string& more = "") {
    const std::string shape = slope_deg == 0 ? R"({"shape": "plane"})"
                                             : fmt::format(R"({{"shape": "tilted-plane",
                                     "slope_deg": {}, "azimuth_deg": {}}})",
                                                           slope_deg, azimuth_deg);
    WriteText(folder_->Path() / (name + ".json"),
              fmt::format(R"({{"schema": "sateen.scene/1", "rig": "true.json", "kind": "sheet",
                  "seed": {}, "surface": {}, "materials": {{"surface": {{{}}}}},
                  "sensor": {{"preset": "nikon-d5100", "black": 600, "full_scale": {}}}{}}})",
                          seed, shape, material, full_scale, more));
    const RunResult run = Simulate({Path(name + ".json"), "-o", Path(name)});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] static std::string Path(const std::string& name) {
    return (folder_->Path() / name).string();
  }

  // A fresh copy of the flat sheet's session, to be spoilt.
  [[nodiscard]] static std::string CopyOfFlat(const std::string& name) {
    fs::copy(Path("flat"), Path(name), fs::copy_options::recursive);
    return Path(name);
  }

  static TempFolder* folder_;
};

TempFolder* CalibrateLightsCommand::folder_ = nullptr;

// How the sheets solve with lights from one way of calibrating.
nlohmann::json Way(const nlohmann::json& report, std::string_view key) {
  for (const nlohmann::json& way : report.at("ways")) {
    if (way.at("way") == key) {
      return way;
    }
  }
  return {};
}

TEST_F(CalibrateLightsCommand, FiveSheetsGivePositionsDirectionsAndFlux) {
  const RunResult run =
      CalibrateLights({"--sheet", Path("flat"), "--sheet", Path("tilt-0"), "--sheet",
                       Path("tilt-1"), "--sheet", Path("tilt-2"), "--sheet", Path("tilt-3"),
                       "--rig", Path("rough.json"), "-o", Path("five.json"), "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  ASSERT_EQ(json.at("lights").size(), 10U);
  for (const nlohmann::json& light : json.at("lights")) {
    // A hundredth of a D5100's pixels: ten times its errors.
    EXPECT_LT(light.at("position_error_mm"), 0.15) << light;
    EXPECT_LT(light.at("direction_error_deg"), 0.015) << light;
    EXPECT_LT(light.at("flux_error"), 1e-3) << light;
    EXPECT_EQ(light.at("model"), "near");
    EXPECT_NEAR(light.at("moved_mm"), 15.0, 0.5);
  }
  fmt::print("{}\n", json.at("ways").dump(1));
  EXPECT_LT(Way(json, "fit").at("flat_sheet_deg"), 0.05);  // the bar
  EXPECT_LT(Way(json, "fit").at("tilted_sheets_deg"), 0.05);
  EXPECT_GT(Way(json, "ruler").at("flat_sheet_deg"), 5.0);
  EXPECT_GT(Way(json, "ruler_fall_off").at("flat_sheet_deg"), 0.3);
  // A map of intensities makes its own sheet flat, and leaves the lights where the ruler had them.
  EXPECT_LT(Way(json, "order_1886_equation").at("flat_sheet_deg"), 0.05);
  EXPECT_GT(Way(json, "order_1886_equation").at("tilted_sheets_deg"), 0.1);
  EXPECT_GT(Way(json, "order_1886_equation").at("direction_error_deg"), 1.0);
  const Rig rig = ReadRig(Path("five.json")).value();
  EXPECT_TRUE(
      rig.calibration.lights.value().inputs.value().contains(Path("flat/frames/led-3.dng")));
  EXPECT_TRUE(fs::exists(Path("five-lights/residuals.png")));
  EXPECT_TRUE(fs::exists(Path("five-lights/before.png")));
}

TEST_F(CalibrateLightsCommand, OneFlatSheetSolvesFlatAndAsksForTilts) {
  const RunResult run = CalibrateLights(
      {"--sheet", Path("flat"), "--rig", Path("rough.json"), "-o", Path("one.json")});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.out, HasSubstr("worst error against truth/rig.json"));
  EXPECT_THAT(run.log, HasSubstr("add sheets tilted by ten degrees"));
  EXPECT_THAT(run.out, HasSubstr("the flat sheet solves flat to 0.0"));

  // The bar: a flat sheet that calibrated nothing then solves flat to 0.05 degrees edge to edge.
  Render("flat-again", 0, 0, 77, R"("albedo": [0.99, 0.99, 0.99])");
  const Sheet again = ReadSheet(Path("flat-again"), {.rig_file = Path("one.json")}).value();
  const SheetReadings view{.columns = again.grid.columns,
                           .rows = again.grid.rows,
                           .samples = again.samples,
                           .blocks = again.blocks};
  const double worst_deg = FlatnessOf(view, again.rig.lights).value().worst_rad / kRadPerDeg;
  fmt::print("another flat sheet solves flat to {:.4f} degrees\n", worst_deg);
  EXPECT_LT(worst_deg, 0.05);

  const RunResult wide = CalibrateLights({"--sheet", Path("flat"), "--rig", Path("rough.json"),
                                          "-o", Path("led.json"), "--model", "led", "--json"});
  ASSERT_EQ(wide.exit_status, 0) << wide.log;
  const nlohmann::json wide_json = wide.Json();
  for (const nlohmann::json& light : wide_json.at("lights")) {
    EXPECT_LT(light.at("direction_error_deg"), 0.25) << light;
  }
}

TEST_F(CalibrateLightsCommand, TheFormerRigIsKept) {
  const std::vector<std::string> words = {"--sheet", Path("flat"),      "--rig", Path("rough.json"),
                                          "-o",      Path("kept.json"), "--json"};
  ASSERT_EQ(CalibrateLights(words).Json().at("former_rig"), "");
  WriteText(folder_->Path() / "kept.json", "mine");

  const RunResult run = CalibrateLights(words);

  ASSERT_EQ(run.exit_status, 0) << run.log;
  std::ifstream former(run.Json().at("former_rig").get<std::string>());
  std::string text;
  former >> text;
  EXPECT_EQ(text, "mine");
}

TEST_F(CalibrateLightsCommand, SwappedFramesAreFoundAndNothingIsWritten) {
  const fs::path swapped = CopyOfFlat("swapped");
  std::ifstream file(swapped / "session.json");
  nlohmann::json session = nlohmann::json::parse(file);
  std::swap(session["frames"][3]["light"], session["frames"][4]["light"]);
  WriteText(swapped / "session.json", session.dump());

  const RunResult run = CalibrateLights(
      {"--sheet", swapped.string(), "--rig", Path("rough.json"), "-o", Path("swapped.json")});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("the frame of light 'led-3' is lit from where light 'led-4' is"));
  EXPECT_FALSE(fs::exists(Path("swapped.json")));
  EXPECT_FALSE(fs::exists(Path("swapped-lights")));
}

// One lamp's frame in two places: its own light is right, the other is that lamp again.
TEST_F(CalibrateLightsCommand, AFrameThatIsThereTwiceIsFound) {
  const fs::path twice = CopyOfFlat("twice");
  std::ifstream file(twice / "session.json");
  nlohmann::json session = nlohmann::json::parse(file);
  for (const char* key : {"file", "sha256"}) {
    session["frames"][4][key] = session["frames"][3][key];
  }
  WriteText(twice / "session.json", session.dump());

  const RunResult run = CalibrateLights(
      {"--sheet", twice.string(), "--rig", Path("rough.json"), "-o", Path("twice.json")});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("the frame of light 'led-4' is lit from where light 'led-3' is"));
  EXPECT_FALSE(fs::exists(Path("twice.json")));
}

// Parts that lens, pose and response wrote at -o stay: the session's own rig is older.
TEST_F(CalibrateLightsCommand, TheRigAtTheOutputIsWhatItAddsTo) {
  fs::copy_file(Path("rough.json"), Path("grown.json"));
  Rig grown = ReadRig(Path("grown.json")).value();
  grown.calibration.lens.emplace().board = "mine";
  WriteText(Path("grown.json"), RigToJson(grown));

  const RunResult run = CalibrateLights({"--sheet", Path("flat"), "-o", Path("grown.json")});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const Rig after = ReadRig(Path("grown.json")).value();
  EXPECT_EQ(after.calibration.lens.value().board, "mine");
  EXPECT_TRUE(after.calibration.lights);
}

TEST_F(CalibrateLightsCommand, BadSheetsAreNamedWithTheirFault) {
  const auto log_of = [&](const std::string& sheet) {
    const RunResult run = CalibrateLights(
        {"--sheet", Path(sheet), "--rig", Path("rough.json"), "-o", Path("bad.json")});
    EXPECT_EQ(run.exit_status, 3);
    EXPECT_FALSE(fs::exists(Path("bad.json")));
    return run.log;
  };
  const std::string white = R"("albedo": [0.99, 0.99, 0.99])";
  Render("bright", 0, 0, 1, white, 0.3);
  EXPECT_THAT(log_of("bright"), HasSubstr("bright/frames/led-0.dng: 100 % of the sheet under light "
                                          "'led-0' is saturated; need less than half"));
  Render("dead", 0, 0, 1, white, 1.5, R"(, "illumination": {"dead": "led-6"})");
  EXPECT_THAT(log_of("dead"), HasSubstr("dead/frames/led-6.dng: 100 % of the sheet under light "
                                        "'led-6' is dark; did the light come on"));
  const fs::path fabric = CopyOfFlat("fabric");
  std::ifstream file(fabric / "session.json");
  nlohmann::json session = nlohmann::json::parse(file);
  session["kind"] = "fabric";
  WriteText(fabric / "session.json", session.dump());
  EXPECT_THAT(log_of("fabric"), HasSubstr("is a session of kind 'fabric'; need a sheet"));
}

TEST_F(CalibrateLightsCommand, ASheetThatDoesNotFillTheTableIsWarnedOfAndLeftOut) {
  Render("small", 0, 0, 1,
         R"("texture": {"kind": "patches", "count": 1, "values": [0.99], "patch_mm": 160})");

  const RunResult run = CalibrateLights({"--sheet", Path("small"), "--rig", Path("rough.json"),
                                         "-o", Path("small-rig.json"), "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("% of the sheet does not follow the light and is left out"));
  const nlohmann::json run_json = run.Json();
  for (const nlohmann::json& light : run_json.at("lights")) {
    EXPECT_LT(light.at("direction_error_deg"), 0.25) << light;
  }
}

TEST_F(CalibrateLightsCommand, OptionsAreChecked) {
  EXPECT_EQ(CalibrateLights({"-o", Path("x.json")}).exit_status, 2);
  EXPECT_EQ(CalibrateLights({"--sheet", Path("flat")}).exit_status, 2);
  const RunResult run = CalibrateLights({"--sheet", Path("flat"), "--rig", Path("rough.json"),
                                         "--albedo", "1.5", "-o", Path("x.json")});
  EXPECT_EQ(run.exit_status, 2);
  EXPECT_THAT(run.log, HasSubstr("albedo = 1.5; need 0 < albedo <= 1"));
  EXPECT_FALSE(fs::exists(Path("x.json")));
}

}  // namespace
}  // namespace sateen::calibrate_lights_test
