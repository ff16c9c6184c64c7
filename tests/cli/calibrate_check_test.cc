#include "cli/calibrate/calibrate_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::calibrate_check_test {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

namespace fs = std::filesystem;

// Today's sheets as a 14-bit camera of 480 x 360 pixels sees them.
class CalibrateCheckCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    std::ifstream sample(fs::path(testing::SourceDir()) / "samples" / "rigs" / "ring10.json");
    rig_ = nlohmann::json::parse(sample);
    rig_["camera"]["size_px"] = {480, 360};
    rig_["camera"]["k"] = {1464.0, 1464.0, 239.5, 179.5};
    Render("clean", rig_, {});
    // The rig that `calibrate lights` would have found, in the units of the frames.
    fs::copy(Path("clean/rig.json"), Path("calibrated.json"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  // A session of white paper under `rig`; `more` goes over the scene's keys.
  static void Render(const std::string& name, const nlohmann::json& rig,
                     const nlohmann::json& more) {
    WriteText(folder_->Path() / (name + "-rig.json"), rig.dump());
    nlohmann::json scene = {
        {"schema", "sateen.scene/1"},
        {"rig", name + "-rig.json"},
        {"kind", "sheet"},
        {"seed", 5},
        {"surface", {{"shape", "plane"}}},
        {"materials", {{"surface", {{"albedo", {0.99, 0.99, 0.99}}}}}},
        {"sensor", {{"preset", "nikon-d5100"}, {"black", 600}, {"full_scale", 1.5}}}};
    if (more.is_object()) {
      scene.update(more);
    }
    WriteText(folder_->Path() / (name + ".json"), scene.dump());
    const RunResult run = Simulate({Path(name + ".json"), "-o", Path(name)});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] static std::string Path(const std::string& name) {
    return (folder_->Path() / name).string();
  }

  static RunResult Check(const std::string& name, std::vector<std::string> more = {"--json"}) {
    std::vector<std::string> words = {"check", "--sheet", Path(name), "--rig",
                                      Path("calibrated.json")};
    words.insert(words.end(), more.begin(), more.end());
    return sateen::testing::RunCommand<cli::CalibrateCheckArgs>(
        std::move(words), cli::AddCalibrateCheck, cli::RunCalibrateCheck);
  }

  // Edits the record of a session.
  template <typename Edit>
  static void EditSession(const std::string& name, const Edit& edit) {
    std::ifstream file(folder_->Path() / name / "session.json");
    nlohmann::json session = nlohmann::json::parse(file);
    edit(session);
    WriteText(folder_->Path() / name / "session.json", session.dump());
  }

  static TempFolder* folder_;
  static nlohmann::json rig_;
};

TempFolder* CalibrateCheckCommand::folder_ = nullptr;
nlohmann::json CalibrateCheckCommand::rig_;

TEST_F(CalibrateCheckCommand, HoldsOnACleanSheetAndDrawsIt) {
  const RunResult run = Check("clean", {"-o", Path("pictures")});

  EXPECT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log,
              HasSubstr("directions that changed by less than 0.23 degrees would go unseen"));
  EXPECT_THAT(run.out,
              HasSubstr("the calibration holds, as far as these sheets can tell (see the note)\n"));
  EXPECT_TRUE(fs::exists(Path("pictures/ratio.png")));
  std::ifstream file(Path("pictures/check.json"));
  const nlohmann::json json = nlohmann::json::parse(file);
  EXPECT_EQ(json.at("schema"), "sateen.calibrate.check/1");
  EXPECT_EQ(json.at("holds"), true);
  EXPECT_EQ(json.at("lights").size(), 10U);
  EXPECT_THAT(json.at("inputs").dump(), HasSubstr("clean/frames/led-3.dng"));
  EXPECT_THAT(Check("clean", {"--max-direction", "0.5"}).out, HasSubstr("the calibration holds\n"));
}

TEST_F(CalibrateCheckCommand, NamesADimLightAndABumpedOne) {
  nlohmann::json rig = rig_;
  rig["lights"][3]["flux_rgb"] = {0.36 * 0.8, 0.36 * 0.8, 0.36 * 0.8};
  rig["lights"][7]["position_mm"][0] = rig["lights"][7]["position_mm"][0].get<double>() + 3.0;
  rig["lights"][7]["position_mm"][2] = rig["lights"][7]["position_mm"][2].get<double>() + 3.0;
  Render("bad", rig, {});

  const RunResult run = Check("bad");

  EXPECT_EQ(run.exit_status, 3);
  const nlohmann::json json = run.Json();
  EXPECT_THAT(json.at("faults"), ElementsAre(HasSubstr("led-3: 80.0 % of its flux: dim"),
                                             HasSubstr("led-7: moved 4.")));
  const nlohmann::json& moved = json.at("lights")[7].at("moved_mm");
  EXPECT_NEAR(moved[0], 3.0, 0.8);
  EXPECT_NEAR(moved[1], 0.0, 0.8);
  EXPECT_NEAR(moved[2], 3.0, 0.8);
  // Wide enough limits let it pass.
  EXPECT_EQ(Check("bad", {"--max-flux", "30", "--max-direction", "2"}).exit_status, 0);
}

// A rig by the ruler, whose fluxes are no measured ones.
TEST_F(CalibrateCheckCommand, RefusesARigThatWasNeverCalibrated) {
  std::ifstream file(folder_->Path() / "calibrated.json");
  nlohmann::json ruler = nlohmann::json::parse(file);
  for (nlohmann::json& light : ruler["lights"]) {
    light["flux_rgb"] = {1, 1, 1};
  }
  WriteText(folder_->Path() / "ruler.json", ruler.dump());
  const RunResult run = sateen::testing::RunCommand<cli::CalibrateCheckArgs>(
      {"check", "--sheet", Path("clean"), "--rig", Path("ruler.json"), "-o", Path("never")},
      cli::AddCalibrateCheck, cli::RunCalibrateCheck);
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("were never calibrated; run sateen calibrate lights"));
  EXPECT_FALSE(fs::exists(Path("never")));
}

TEST_F(CalibrateCheckCommand, NamesAMovedCamera) {
  nlohmann::json rig = rig_;
  rig["camera"]["table_from_camera"][3] = 1.0;
  Render("nudged", rig, {});
  const RunResult run = Check("nudged");

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.Json().at("faults"), ElementsAre(HasSubstr("camera: moved 1.0 mm (x +1.0, y ")));

  Render("bumped", rig_, {{"lens", {{"bump", {{"from", "led-0"}, {"shift_px", {4.0, 0.0}}}}}}});
  // 4 px of 0.42 mm; the picture's content goes right when the camera goes left.
  EXPECT_THAT(Check("bumped").Json().at("faults"),
              ElementsAre(HasSubstr("camera: moved 1.7 mm (x -1.7, y ")));
}

TEST_F(CalibrateCheckCommand, NamesADeadLightAndSwappedOnes) {
  Render("dead", rig_, {{"illumination", {{"dead", "led-6"}}}});
  EXPECT_THAT(Check("dead").Json().at("faults"), ElementsAre(HasSubstr("led-6: dark")));

  fs::copy(Path("clean"), Path("swapped"), fs::copy_options::recursive);
  EditSession("swapped", [](nlohmann::json& session) {
    std::swap(session["frames"][3]["light"], session["frames"][4]["light"]);
  });
  const RunResult run = Check("swapped");
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.Json().at("faults"),
              ElementsAre(HasSubstr("led-3: its frame is lit from where led-4 is"),
                          HasSubstr("led-4: its frame is lit from where led-3 is")));

  fs::copy(Path("clean"), Path("missing"), fs::copy_options::recursive);
  EditSession("missing", [](nlohmann::json& session) { session["frames"].erase(2); });
  EXPECT_THAT(Check("missing").Json().at("faults"), ElementsAre(HasSubstr("led-2: dark")));
}

TEST_F(CalibrateCheckCommand, NamesAFoldTheRoomsLightAndASmallSheet) {
  // A riser of 2.9 degrees, 4 mm wide, across the paper.
  Render(
      "fold", rig_,
      {{"kind", "chart"},
       {"surface",
        {{"shape", "steps"}, {"count", 1}, {"tread_mm", 20}, {"rise_mm", 0.2}, {"riser_mm", 4}}}});
  EditSession("fold", [](nlohmann::json& session) { session["kind"] = "sheet"; });
  const RunResult fold = Check("fold");
  EXPECT_EQ(fold.exit_status, 0);
  EXPECT_GT(fold.Json().at("sheets")[0].at("folds_percent"), 1.0);
  EXPECT_THAT(fold.log, HasSubstr("% folds up to"));

  Render("room", rig_, {{"illumination", {{"ambient_rgb", {0.05, 0.05, 0.05}}}}});
  EXPECT_THAT(Check("room").Json().at("faults"),
              ElementsAre(HasSubstr("switch off the room's lights")));

  Render("small", rig_,
         {{"materials",
           {{"surface",
             {{"texture",
               {{"kind", "patches"}, {"count", 1}, {"values", {0.99}}, {"patch_mm", 160}}}}}}}});
  EXPECT_THAT(Check("small").Json().at("faults"), ElementsAre(HasSubstr("has spots or no paper")));
}

TEST_F(CalibrateCheckCommand, OptionsAreChecked) {
  EXPECT_EQ(Check("clean", {"--significance", "1"}).exit_status, 2);
  EXPECT_EQ(Check("clean", {"--max-flux", "nan"}).exit_status, 2);
  EXPECT_EQ(Check("nowhere").exit_status, 4);
  EXPECT_THAT(Check("clean").Json().at("faults"), IsEmpty());
}

}  // namespace
}  // namespace sateen::calibrate_check_test
