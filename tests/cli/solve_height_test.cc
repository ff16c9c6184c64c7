#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "core/angle.h"
#include "imaging/image_io.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::solve_height_test {
namespace {

using namespace sateen::testing;  // NOLINT(google-build-using-namespace): the cases of this file
using ::testing::HasSubstr;

// A scene under eight lights that are 280 mm away, rendered where its surface is.
class SolveHeight : public ::testing::Test {
 protected:
  void Render(const std::string& surface, const std::vector<std::string>& options = {}) {
    std::string lights;
    for (int k = 0; k < 8; ++k) {
      const double around = k * std::numbers::pi / 4.0;
      const double polar = (k % 2 == 0 ? 45.0 : 25.0) * kRadPerDeg;
      lights += fmt::format(R"({}{{"name": "l{}", "channel": {}, "model": "near",
          "position_mm": [{}, {}, {}], "flux_rgb": [0.08, 0.08, 0.08]}})",
                            k == 0 ? "" : ",", k, k, 280.0 * std::sin(polar) * std::cos(around),
                            280.0 * std::sin(polar) * std::sin(around), 280.0 * std::cos(polar));
    }
    WriteText(folder_.Path() / "rig.json",
              fmt::format(R"({{"schema": "sateen.rig/1", "camera": {{"model": "m",
        "size_px": [160, 120], "k": [500, 500, 79.5, 59.5], "distortion": [0, 0, 0, 0, 0],
        "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 450, 0, 0, 0, 1]}},
        "lights": [{}]}})",
                          lights));
    WriteText(folder_.Path() / "scene.json", fmt::format(R"({{"schema": "sateen.scene/1",
        "rig": "rig.json", "surface": {},
        "materials": {{"surface": {{"albedo": [0.5, 0.6, 0.7]}}}},
        "illumination": {{"shadows": "attached"}}}})",
                                                         surface));
    std::vector<std::string> words = {Path("scene.json"), "-o", Path("session")};
    words.insert(words.end(), options.begin(), options.end());
    const RunResult run = Simulate(words);
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }
  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_.Path() / name).string();
  }
  [[nodiscard]] RunResult SolveSession(std::vector<std::string> words) const {
    words.insert(words.begin(), {Path("session"), "-o", Path("maps"), "--json"});
    return Solve(words);
  }
  [[nodiscard]] double ErrorDeg(std::vector<std::string> words) const {
    const RunResult run = SolveSession(std::move(words));
    EXPECT_EQ(run.exit_status, 0) << run.log;
    return run.exit_status == 0 ? run.Json()["angular_error_deg"]["mean"].get<double>() : 180.0;
  }

  TempFolder folder_;
};

TEST_F(SolveHeight, OfAThickClothIsAsGoodAsTheTables) {
  Render(R"({"shape": "plane", "height_mm": 5})", {"--linear"});
  const double on_table = ErrorDeg({});
  EXPECT_GT(on_table, 0.3);
  EXPECT_LT(ErrorDeg({"--height", "5"}), 1e-4);
  EXPECT_GT(ErrorDeg({"--height", "-5"}), 1.5 * on_table);
}

TEST_F(SolveHeight, OfReliefIsFoundFromTheNormals) {
  Render(R"({"shape": "waves", "period_mm": 100, "max_slope_deg": 25})");
  for (const std::string domain : {"raw", "rgb"}) {
    SCOPED_TRACE(domain);
    const double on_table = ErrorDeg({"--domain", domain});
    EXPECT_FALSE(std::filesystem::exists(Path("maps/height.exr")));
    const RunResult run = SolveSession({"--domain", domain, "--relief"});
    ASSERT_EQ(run.exit_status, 0) << run.log;

    const nlohmann::json report = run.Json();
    EXPECT_EQ(report["domain"], domain);
    EXPECT_LT(report["angular_error_deg"]["mean"].get<double>(), 0.1 * on_table);
    EXPECT_NEAR(report["relief"]["turned_deg"]["mean"].get<double>(), on_table, 0.2 * on_table);
    EXPECT_TRUE(report["options"]["relief"].get<bool>());
    const Image<float> found = ReadPhoto(Path("maps/height.exr")).value().rgb[0];
    const Image<float> truth = ReadPhoto(Path("session/truth/height.exr")).value().rgb[0];
    double mean = 0.0;
    for (size_t p = 0; p < truth.pixels.size(); ++p) {
      mean += static_cast<double>(truth.pixels[p]) / static_cast<double>(truth.pixels.size());
    }
    double worst = 0.0;
    for (size_t p = 0; p < truth.pixels.size(); ++p) {
      worst =
          std::max(worst, std::abs(static_cast<double>(found.pixels[p] - truth.pixels[p]) + mean));
    }
    EXPECT_LT(worst, 0.5);  // against 20 mm of height
    EXPECT_LT(report["relief"]["height_mm"][0].get<double>(), -8.0);
    EXPECT_GT(report["relief"]["height_mm"][1].get<double>(), 8.0);
  }
  // Nothing is left of an earlier run.
  EXPECT_EQ(SolveSession({}).exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(Path("maps/height.exr")));
}

TEST_F(SolveHeight, MeanIsThatOfTheOptionAndMapsMayBeUndistorted) {
  Render(R"({"shape": "waves", "period_mm": 100, "max_slope_deg": 10})", {"--linear"});
  ASSERT_EQ(SolveSession({"--relief", "--height", "3", "--undistort"}).exit_status, 0);
  double mean = 0.0;
  const Image<float> height = ReadPhoto(Path("maps/height.exr")).value().rgb[0];
  for (const float z : height.pixels) {
    mean += static_cast<double>(z) / static_cast<double>(height.pixels.size());
  }
  EXPECT_NEAR(mean, 3.0, 1e-3);
}

TEST_F(SolveHeight, IsRefusedWhereNoLightTellsOfItOrOneIsTooLow) {
  Render(R"({"shape": "plane"})", {"--linear"});
  for (const char* height : {"198", "50", "-60", "nan", "inf"}) {
    const RunResult run = SolveSession({"--height", height});
    EXPECT_EQ(run.exit_status, 2) << height;
    EXPECT_THAT(run.log, HasSubstr("the lowest light is 198 mm above the table; need a surface "
                                   "within a quarter of that, from -49.5 to 49.5 mm"))
        << height;
  }
  EXPECT_EQ(SolveSession({"--height", "thick"}).exit_status, 2);

  std::filesystem::create_directory(Path("far"));
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(WriteExr(folder_.Path() / fmt::format("far/{}.exr", k), Image3({8, 8}, 0.5F)));
  }
  WriteText(folder_.Path() / "far/lights.txt", "0.6 0 0.8\n0 0.6 0.8\n-0.6 0 0.8\n");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"--relief"}, std::vector<std::string>{"--height", "5"}}) {
    std::vector<std::string> all = {Path("far"), "-o", Path("maps")};
    all.insert(all.end(), words.begin(), words.end());
    const RunResult run = Solve(all);
    EXPECT_EQ(run.exit_status, 3);
    EXPECT_THAT(run.log, HasSubstr("all 3 lights are distant"));
    EXPECT_THAT(run.log, HasSubstr(words[0] + " needs lights with a position"));
  }
}

}  // namespace
}  // namespace sateen::solve_height_test
