#include "cli/calibrate/calibrate_lens.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "cli/calibrate/calibrate_pose.h"
#include "core/files/file_io.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::calibrate_lens_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

RunResult CalibrateLens(std::vector<std::string> words) {
  words.insert(words.begin(), "lens");
  return RunCommand<cli::CalibrateLensArgs>(std::move(words), cli::AddCalibrateLens,
                                            cli::RunCalibrateLens);
}

RunResult CalibratePose(std::vector<std::string> words) {
  words.insert(words.begin(), "pose");
  return RunCommand<cli::CalibratePoseArgs>(std::move(words), cli::AddCalibratePose,
                                            cli::RunCalibratePose);
}

std::string Text(const fs::path& path) { return ReadFileBytes(path).value(); }

constexpr const char* kBoard = "charuco:10x7:25mm:18mm";

// Sessions of a ChArUco board tilted each way, and of one lying on the table, under a lens that
// bends lines, rendered once. The camera leans by some 8 degrees.
class CalibrateLensCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    WriteText(folder_->Path() / "true.json", R"({"schema": "sateen.rig/1",
      "camera": {"model": "simulated", "size_px": [640, 480], "k": [720, 719, 322.4, 236.1],
        "distortion": [-0.25, 0.1, 0.001, -0.0008, 0],
        "table_from_camera": [1, 0, 0, -8, 0, -0.99, -0.14106735979665885, 61, 0,
          0.14106735979665885, -0.99, 430, 0, 0, 0, 1]},
      "lights": [{"name": "a", "channel": 0, "model": "distant", "direction": [0, 0, 1],
        "flux_rgb": [1, 1, 1]}]})");
    for (int i = 0; i < 8; ++i) {
      Render(fmt::format("boards/view-{}", i + 1),
             fmt::format(R"("shape": "tilted-plane", "slope_deg": 30, "azimuth_deg": {})",
                         100 * i % 360),
             fmt::format("[{}, {}]", 60 * (i % 3 - 1), 40 * (i / 3 - 1)), 25 * i);
    }
    Render("table", R"("shape": "plane")", "[0, 0]", 12, /*linear=*/false);
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static void Render(const std::string& name, const std::string& shape, const std::string& offset,
                     int turn_deg, bool linear = true, const std::string& rig = "true.json",
                     int samples = 4) {
    const fs::path scene = folder_->Path() / "scene.json";
    WriteText(scene, fmt::format(R"({{"schema": "sateen.scene/1", "rig": "{}",
        "kind": "board", "surface": {{{}}}, "materials": {{"surface": {{"texture":
        {{"kind": "print", "target": "{}", "dark": 0.04, "light": 0.9, "offset_mm": {},
        "turn_deg": {}}}}}}}, "lens": {{"samples": {}}}, "sensor": {{"preset": "nikon-d5100",
        "black": 600, "full_scale": 1.2}}}})",
                                 rig, shape, kBoard, offset, turn_deg, samples));
    std::vector<std::string> words = {scene.string(), "-o", (folder_->Path() / name).string()};
    if (linear) {
      words.push_back("--linear");
    }
    const RunResult run = Simulate(words);
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] static std::string Path(const std::string& name) {
    return (folder_->Path() / name).string();
  }

  static TempFolder* folder_;
};

TempFolder* CalibrateLensCommand::folder_ = nullptr;

TEST_F(CalibrateLensCommand, LensThenPoseOfSimulatedBoards) {
  const RunResult lens = CalibrateLens(
      {Path("boards"), "--board", kBoard, "-o", Path("new.json"), "--json", "--threads", "2"});
  ASSERT_EQ(lens.exit_status, 0) << lens.log;
  const nlohmann::json figures = lens.Json();
  const Rig half = ReadRig(Path("new.json")).value();
  EXPECT_FALSE(half.camera->has_pose);
  EXPECT_EQ(half.camera->fx, figures["k"][0].get<double>());
  EXPECT_EQ(figures["views"].size(), 8U);

  const RunResult pose = CalibratePose({Path("table"), "-o", Path("new.json"), "--json"});
  ASSERT_EQ(pose.exit_status, 0) << pose.log;
  const nlohmann::json where = pose.Json();
  const Camera camera = ReadRig(Path("new.json")).value().camera.value();
  EXPECT_TRUE(camera.has_pose);
  EXPECT_EQ(camera.fx, half.camera->fx);
  EXPECT_EQ(where["board"], figures["board"]);  // taken from the lens's record
  EXPECT_THAT(where["former_rig"].get<std::string>(), HasSubstr("new-2"));
  for (const char* picture : {"new-lens/coverage.png", "new-lens/residuals.png",
                              "new-lens/undistorted.png", "new-pose/axes.png"}) {
    EXPECT_TRUE(ReadPhoto(Path(picture))) << picture;
  }

  fmt::print(
      "lens of 8 views: focal {:.4f} % off, principal point {:.3f} px, error {:.3f} px, "
      "held out {:.3f} px; pose {:.4f} mm, {:.4f} degrees off, +- {} mm\n",
      100.0 * figures["focal_error"].get<double>(), figures["principal_error_px"].get<double>(),
      figures["rms_px"].get<double>(), figures["held_out_rms_px"].get<double>(),
      where["position_error_mm"].get<double>(), where["rotation_error_deg"].get<double>(),
      where["position_sd_mm"].dump());
  EXPECT_LT(figures["focal_error"].get<double>(), 1e-3);
  EXPECT_LT(figures["principal_error_px"].get<double>(), 1.0);
  EXPECT_LT(figures["line_deviation_px"]["after"].get<double>(), 0.3);  // noise of single corners
  EXPECT_GT(figures["line_deviation_px"]["before"].get<double>(),
            2.0 * figures["line_deviation_px"]["after"].get<double>());
  // The lens's own error moves the pose with it, most of all its focal length the distance.
  EXPECT_LT(where["position_error_mm"].get<double>(), 1.0);
  EXPECT_LT(where["rotation_error_deg"].get<double>(), 0.1);
}

// With the true lens, so that only the pose is tested: three megapixels, where a pixel is 0.2 mm.
TEST_F(CalibrateLensCommand, PoseOfThreeMegapixelsUnderTheTrueLens) {
  WriteText(Path("fine.json"), R"({"schema": "sateen.rig/1",
      "camera": {"model": "simulated", "size_px": [2048, 1536], "k": [2304, 2300.8, 1032.78, 756.62],
        "distortion": [-0.25, 0.1, 0.001, -0.0008, 0],
        "table_from_camera": [1, 0, 0, -8, 0, -0.99, -0.14106735979665885, 61, 0,
          0.14106735979665885, -0.99, 430, 0, 0, 0, 1]},
      "lights": [{"name": "a", "channel": 0, "model": "distant", "direction": [0, 0, 1],
        "flux_rgb": [1, 1, 1]}]})");
  Render("fine-table", R"("shape": "plane")", "[0, 0]", 12, /*linear=*/false, "fine.json", 2);
  const RunResult run = CalibratePose({Path("fine-table"), "--board", kBoard, "--rig",
                                       Path("fine.json"), "-o", Path("fine-posed.json"), "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json where = run.Json();
  fmt::print("pose of 3 megapixels: {:.4f} mm, {:.4f} degrees off, +- {} mm\n",
             where["position_error_mm"].get<double>(), where["rotation_error_deg"].get<double>(),
             where["position_sd_mm"].dump());
  EXPECT_LT(where["position_error_mm"].get<double>(), 0.1);
  EXPECT_LT(where["rotation_error_deg"].get<double>(), 0.05);
}

// The same with pixels of 0.6 mm, of which the bound of 0.1 mm asks too much.
TEST_F(CalibrateLensCommand, PoseUnderTheTrueLens) {
  const RunResult run = CalibratePose({Path("table"), "--board", kBoard, "--rig", Path("true.json"),
                                       "-o", Path("posed.json"), "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json where = run.Json();
  fmt::print("pose under the true lens: {:.4f} mm, {:.4f} degrees off, +- {} mm\n",
             where["position_error_mm"].get<double>(), where["rotation_error_deg"].get<double>(),
             where["position_sd_mm"].dump());
  EXPECT_LT(where["position_error_mm"].get<double>(), 0.4);
  EXPECT_LT(where["rotation_error_deg"].get<double>(), 0.05);
  EXPECT_EQ(ReadRig(Path("posed.json")).value().lights.size(), 1U);

  // A board 3 mm thick: the camera is as much higher above the table, and nothing else changes.
  const RunResult thick =
      CalibratePose({Path("table"), "--board", kBoard, "--rig", Path("true.json"), "-o",
                     Path("thick.json"), "--thickness", "3"});
  ASSERT_EQ(thick.exit_status, 0) << thick.log;
  const Eigen::Isometry3d a = ReadRig(Path("posed.json"))->camera->table_from_camera;
  const Eigen::Isometry3d b = ReadRig(Path("thick.json"))->camera->table_from_camera;
  EXPECT_LT((b.translation() - a.translation() - Eigen::Vector3d(0, 0, 3)).norm(), 1e-9);
  EXPECT_LT((b.linear() - a.linear()).norm(), 1e-12);
}

// The error against the truth is that in the frame of the board, which lies aside and turned.
TEST_F(CalibrateLensCommand, PoseOfABoardLyingAside) {
  Render("aside", R"("shape": "plane")", "[25, -15]", 20, /*linear=*/false);
  const RunResult run = CalibratePose({Path("aside"), "--board", kBoard, "--rig", Path("true.json"),
                                       "-o", Path("aside.json"), "--thickness", "3", "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_LT(run.Json().at("position_error_mm").get<double>(), 0.4);
  EXPECT_LT(run.Json().at("rotation_error_deg").get<double>(), 0.05);
  const Eigen::Isometry3d pose = ReadRig(Path("aside.json"))->camera->table_from_camera;
  EXPECT_NEAR(pose.translation().x(), -8.0 - 25.0, 1.0);
  EXPECT_THAT(run.log, Not(HasSubstr("measure its squares")));

  // Printed at 90 % of what it says.
  const RunResult shrunk = CalibratePose({Path("aside"), "--board", "charuco:10x7:27.8mm:20mm",
                                          "--rig", Path("true.json"), "-o", Path("shrunk.json")});
  ASSERT_EQ(shrunk.exit_status, 0) << shrunk.log;
  EXPECT_THAT(shrunk.log, HasSubstr("mm above the table, 430 mm by the previous pose: unless it "
                                    "was moved, the board is not of the size that "
                                    "charuco:10x7:27.8mm:20mm"));
}

TEST_F(CalibrateLensCommand, KeepsTheRestOfTheRigAndSaysWhatIsOutOfDate) {
  Rig rig = ReadRig(Path("true.json")).value();
  rig.lights[0].model = LightModel::kNear;
  rig.lights[0].position_mm = {10, 20, 500};
  rig.response = Response{.black = 5, .white = 100};
  rig.calibration.lights.emplace().date = "then";
  WriteText(Path("whole.json"), RigToJson(rig));
  const std::string before = Text(Path("whole.json"));
  const RunResult lens =
      CalibrateLens({Path("boards"), "--board", kBoard, "-o", Path("whole.json")});
  ASSERT_EQ(lens.exit_status, 0) << lens.log;
  EXPECT_THAT(lens.log, HasSubstr("found with the previous lens; run sateen calibrate pose again, "
                                  "then sateen calibrate lights"));
  const Rig after = ReadRig(Path("whole.json")).value();
  EXPECT_EQ(after.lights[0].position_mm, rig.lights[0].position_mm);
  EXPECT_EQ(after.response->white, 100);
  EXPECT_THAT(lens.log, Not(HasSubstr("is lost there")));
  // A rig given with --rig that was never calibrated takes the place of one that was.
  fs::copy(Path("whole.json"), Path("replaced.json"));
  const RunResult replaced = CalibrateLens(
      {Path("boards"), "--board", kBoard, "--rig", Path("true.json"), "-o", Path("replaced.json")});
  ASSERT_EQ(replaced.exit_status, 0) << replaced.log;
  EXPECT_THAT(replaced.log,
              HasSubstr("the calibration of lights in " + Path("replaced.json") + " is not"));
  EXPECT_EQ(after.camera->table_from_camera.matrix(), rig.camera->table_from_camera.matrix());
  EXPECT_NE(after.camera->fx, rig.camera->fx);
  EXPECT_EQ(after.calibration.lights.value().date, "then");
  EXPECT_EQ(after.calibration.lens.value().inputs.value().size(),
            16U);  // record and frame of each view
  bool kept = false;
  for (const auto& entry : fs::directory_iterator(folder_->Path())) {
    kept = kept || (entry.path().filename().string().starts_with("whole-2") &&
                    Text(entry.path()) == before);
  }
  EXPECT_TRUE(kept);
  const RunResult pose =
      CalibratePose({Path("table"), "--board", kBoard, "-o", Path("whole.json")});
  ASSERT_EQ(pose.exit_status, 0) << pose.log;
  EXPECT_THAT(pose.log, HasSubstr("run sateen calibrate lights again"));
}

TEST_F(CalibrateLensCommand, NamesWhatItCannotUse) {
  const fs::path mixed = folder_->Path() / "mixed";
  fs::copy(folder_->Path() / "boards", mixed, fs::copy_options::recursive);
  WriteText(mixed / "notes.txt", "taken on Monday");
  ASSERT_TRUE(WritePng8(mixed / "blank.png", Image<uint8_t>(640, 480, 128)));
  ASSERT_TRUE(WritePng8(mixed / "small.png", Image<uint8_t>(320, 240, 128)));
  WriteText(mixed / "broken.jpg", "no picture");
  const RunResult run =
      CalibrateLens({mixed.string(), "--board", kBoard, "-o", Path("mixed.json"), "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("ignored: notes.txt: not a photograph"));
  EXPECT_THAT(run.log, HasSubstr("blank.png is not used: 0 markers of DICT_4X4_50 found"));
  EXPECT_THAT(run.log, HasSubstr("small.png is not used: is 320 x 240 px, and most are 640 x 480"));
  EXPECT_THAT(run.log, HasSubstr("broken.jpg is not used: "));
  EXPECT_EQ(run.Json()["views"].size(), 11U);
}

// Every error leaves the rig, byte for byte, and no pictures.
TEST_F(CalibrateLensCommand, AnErrorLeavesTheRigAlone) {
  const std::string rig = Text(Path("true.json"));
  WriteText(Path("safe.json"), rig);
  const auto fails = [&](const RunResult& run, int status, const std::string& words) {
    EXPECT_EQ(run.exit_status, status) << run.log;
    EXPECT_THAT(run.log, HasSubstr(words));
    EXPECT_EQ(Text(Path("safe.json")), rig);
    EXPECT_FALSE(fs::exists(Path("safe-lens")));
    EXPECT_FALSE(fs::exists(Path("safe-pose")));
  };
  const auto lens = [&](const std::string& photos, const std::string& board) {
    return CalibrateLens({Path(photos), "--board", board, "-o", Path("safe.json")});
  };
  const auto pose = [&](const std::string& photos, const std::string& board) {
    return CalibratePose({Path(photos), "--board", board, "-o", Path("safe.json")});
  };
  fails(lens("boards", "charuco:9x7:25mm:18mm"), 3, "is in none of 8 photographs; view-1: ");
  fails(lens("table", "chessboard:9x6:25mm"), 3, "table: no chessboard");
  fails(lens("boards", "charuco:9x7"), 2, "board 'charuco:9x7'; need");
  fails(lens("table", kBoard), 3, "1 usable views of the board of 1; need 3");
  fails(lens("nothing", kBoard), 4, "nothing: does not exist");
  fails(pose("table", "charuco:9x7:25mm:18mm"), 3, "is in none of 1 photographs");
  fails(pose("boards", kBoard), 3, "the board or the camera moved");
  fails(pose("table", ""), 2, "does not say which board");
  fs::create_directories(folder_->Path() / "empty");
  fails(lens("empty", kBoard), 3, "found 0 files; need photographs of a board");
  const RunResult none =
      CalibratePose({Path("table"), "--board", kBoard, "-o", Path("absent.json")});
  fails(none, 3, "has no camera; run sateen calibrate lens first");
  EXPECT_FALSE(fs::exists(Path("absent.json")));
}

TEST(CalibrateLensOfPhotographs, FourteenOfOpenCv) {
  SATEEN_NEEDS_DATA("lens/opencv-left");
  TempFolder folder;
  const RunResult run =
      CalibrateLens({(DataDir() / "lens/opencv-left").string(), "--board", "chessboard:9x6:25mm",
                     "-o", (folder.Path() / "rig.json").string(), "--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, Not(HasSubstr("not used")));
  EXPECT_EQ(run.Json()["views"].size(), 14U);
  EXPECT_LT(run.Json()["rms_px"].get<double>(), 0.2);
  EXPECT_LT(run.Json()["line_deviation_px"]["after"].get<double>(),
            0.1 * run.Json()["line_deviation_px"]["before"].get<double>());
}

// 20 x 20 squares of 4 mm, markers of 3.2 mm, of which each photograph shows a third. Its authors
// accept a mean error of 1.3 px. Its top left square is black, so it is not of the legacy pattern.
TEST(CalibrateLensOfPhotographs, CharucoOfWhichPhotographsShowParts) {
  SATEEN_NEEDS_DATA("lens/charuco-pycamset");
  TempFolder folder;
  const auto run = [&](const std::string& board) {
    return CalibrateLens({(DataDir() / "lens/charuco-pycamset/cam1").string(), "--board", board,
                          "-o", (folder.Path() / "rig.json").string(), "--json"});
  };
  const RunResult taken = run("charuco:20x20:4mm:3.2mm:DICT_4X4_1000");
  ASSERT_EQ(taken.exit_status, 0) << taken.log;
  const nlohmann::json figures = taken.Json();
  size_t used = 0;
  for (const nlohmann::json& view : figures["views"]) {
    used += view["used"].get<bool>() ? 1 : 0;
  }
  fmt::print("charuco-pycamset: {} of {} views, error {:.3f} px, held out {:.3f} px\n", used,
             figures["views"].size(), figures["rms_px"].get<double>(),
             figures["held_out_rms_px"].get<double>());
  EXPECT_GE(used, 16U);
  EXPECT_LT(figures["rms_px"].get<double>(), 1.5);
  EXPECT_THAT(taken.log, HasSubstr("cal16.jpg is blurred"));
  const RunResult legacy = run("charuco:20x20:4mm:3.2mm:DICT_4X4_1000:legacy");
  EXPECT_EQ(legacy.exit_status, 3);
  EXPECT_THAT(legacy.log, HasSubstr("or of the other pattern"));
}

}  // namespace
}  // namespace sateen::calibrate_lens_test
