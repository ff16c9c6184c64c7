#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "imaging/image_io.h"
#include "solver/evaluate.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::undistort_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;

// Waves under a camera that bends lines by 10 px at the corners, or by nothing.
void WriteScene(const std::filesystem::path& folder, const std::string& name,
                const std::string& distortion) {
  std::string lights;
  for (const char* direction :
       {"[0.6, 0, 0.8]", "[0, 0.6, 0.8]", "[-0.6, 0, 0.8]", "[0, -0.6, 0.8]"}) {
    lights += fmt::format(R"({}{{"name": "l{}", "channel": 0, "model": "distant",
        "direction": {}, "flux_rgb": [1, 1, 1]}})",
                          lights.empty() ? "" : ",", lights.size(), direction);
  }
  WriteText(folder / (name + "-rig.json"),
            fmt::format(R"({{"schema": "sateen.rig/1", "camera": {{"model": "m",
      "size_px": [320, 240], "k": [360, 360, 162, 118], "distortion": {},
      "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 400, 0, 0, 0, 1]}},
      "lights": [{}]}})",
                        distortion, lights));
  WriteText(folder / (name + ".json"), fmt::format(R"({{"schema": "sateen.scene/1",
      "rig": "{}-rig.json", "surface": {{"shape": "waves", "period_mm": 60, "max_slope_deg": 15}},
      "materials": {{"surface": {{"albedo": [0.5, 0.6, 0.7]}}}},
      "illumination": {{"shadows": "attached"}}}})",
                                                   name));
}

// The maps of a bent camera, undistorted, are those of the same scene under the pinhole camera.
TEST(SolveUndistort, GivesThePinholeCamerasTruth) {
  TempFolder folder;
  WriteScene(folder.Path(), "bent", "[-0.3, 0.1, 0.002, -0.001, 0]");
  WriteScene(folder.Path(), "ideal", "[0, 0, 0, 0, 0]");
  const auto path = [&](const std::string& name) { return (folder.Path() / name).string(); };
  for (const std::string name : {"bent", "ideal"}) {
    const RunResult run = Simulate({path(name + ".json"), "-o", path(name), "--linear"});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }
  const Image3 truth = ReadImage3(folder.Path() / "ideal/truth/normal.exr").value();
  const auto error_deg = [&](std::vector<std::string> words, const std::string& maps) {
    words.insert(words.begin(), {path("bent"), "-o", path(maps), "--json"});
    const RunResult run = Solve(words);
    EXPECT_EQ(run.exit_status, 0) << run.log;
    const bool undistorted = run.Json()["options"]["undistort"].get<bool>();
    EXPECT_EQ(run.Json().contains("map_camera"), undistorted);
    NormalField field;
    field.normal = ReadImage3(folder.Path() / maps / "normal.exr").value();
    field.reason = Image<uint8_t>(field.normal.Size());
    for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
      field.reason.pixels[p] = field.normal[2].pixels[p] > 0.0F ? 255 : 0;
    }
    return AngularErrorDeg(field, truth).value();
  };
  const ErrorStatistics bent = error_deg({}, "as-photographed");
  const ErrorStatistics straight = error_deg({"--undistort"}, "undistorted");
  fmt::print(
      "against the pinhole camera's truth: {:.3f} degrees, undistorted {:.4f} (worst {:.3f})\n",
      bent.mean, straight.mean, straight.max);
  EXPECT_GT(bent.mean, 0.5);
  EXPECT_LT(straight.mean, 0.01);
  EXPECT_LT(straight.max, 0.2);  // linear between pixels at the border
  EXPECT_EQ(straight.count, 320 * 240);
}

TEST(SolveUndistort, NeedsACamera) {
  TempFolder folder;
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(WriteExr(folder.Path() / fmt::format("{}.exr", k), Image3({8, 8}, 0.5F)));
  }
  WriteText(folder.Path() / "lights.txt", "0.6 0 0.8\n0 0.6 0.8\n-0.6 0 0.8\n");
  const RunResult run =
      Solve({folder.Path().string(), "-o", (folder.Path() / "maps").string(), "--undistort"});
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("--undistort needs the lens, and the rig has no camera"));
  EXPECT_FALSE(std::filesystem::exists(folder.Path() / "maps"));
}

}  // namespace
}  // namespace sateen::undistort_test
