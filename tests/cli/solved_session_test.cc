#include <gmock/gmock.h>

#include "cli/session_overview.h"
#include "imaging/image_io.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

// Products of a session and the maps of its solve.
namespace sateen::solved_session_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::RunResult;
using testing::TempFolder;

constexpr const char* kRig = R"({
  "schema": "sateen.rig/1",
  "camera": {"model": "test", "size_px": [48, 32], "k": [146.4, 146.4, 23.5, 15.5],
             "distortion": [0, 0, 0, 0, 0],
             "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 610, 0, 0, 0, 1]},
  "lights": [
    {"name": "east", "channel": 0, "model": "distant", "direction": [0.6, 0, 0.8], "flux_rgb": [0.4, 0.4, 0.4]},
    {"name": "north", "channel": 1, "model": "distant", "direction": [0, 0.6, 0.8], "flux_rgb": [0.4, 0.4, 0.4]},
    {"name": "west", "channel": 2, "model": "distant", "direction": [-0.6, 0, 0.8], "flux_rgb": [0.4, 0.4, 0.4]},
    {"name": "south", "channel": 3, "model": "distant", "direction": [0, -0.6, 0.8], "flux_rgb": [0.4, 0.4, 0.4]}]
})";

class SolvedSession : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::WriteText(Path("rig.json"), kRig);
    for (const auto& [name, radius] : {std::pair{"dome", "240"}, std::pair{"hill", "300"}}) {
      testing::WriteText(Path(std::string(name) + ".json"),
                         std::string(R"({"schema": "sateen.scene/1", "rig": "rig.json",
                           "materials": {"surface": {"texture": {"kind": "waves", "min": 0.2, "max": 0.8, "period_mm": 100}}},
                           "surface": {"shape": "sphere", "edge_deg": 30, "radius_mm": )") +
                             radius + "}}");
      const RunResult run =
          testing::Simulate({Path(std::string(name) + ".json"), "-o", Path(name), "--linear"});
      ASSERT_EQ(run.exit_status, 0) << run.log;
    }
    const RunResult run = testing::Solve({Path("dome"), "-o", Path("maps")});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_.Path() / name).string();
  }
  [[nodiscard]] RunResult Overview(const std::string& session, const std::string& maps) const {
    return testing::RunCommand<cli::SessionOverviewArgs>(
        {"overview", Path(session), "--maps", Path(maps), "-o", Path("sheet.png")},
        cli::AddSessionOverview, cli::RunSessionOverview);
  }

 private:
  TempFolder folder_;
};

TEST_F(SolvedSession, IsShownWithItsMaps) {
  const RunResult shown = Overview("dome", "maps");
  EXPECT_EQ(shown.exit_status, 0) << shown.log;
  EXPECT_TRUE(fs::exists(Path("sheet.png")));
}

// The maps have the same size, so that nothing but the hashes tells.
TEST_F(SolvedSession, IsNotShownWithTheMapsOfAnother) {
  const RunResult refused = Overview("hill", "maps");
  EXPECT_EQ(refused.exit_status, 3);
  EXPECT_THAT(refused.log, HasSubstr("solve.json: lists other frames than those of"));
  fs::remove(Path("maps/solve.json"));
  EXPECT_EQ(Overview("dome", "maps").exit_status, 4);
  EXPECT_FALSE(fs::exists(Path("sheet.png")));
}

TEST_F(SolvedSession, OverviewOfASolveHasCaptions) {
  const Result<Photo> picture = ReadPhoto(Path("maps/overview.png"));
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_EQ(picture->rgb[0].width, 4 * 48 + 3 * 4);
  EXPECT_GT(picture->rgb[0].height, 32 + 12);  // capitals are 12 px high
}

// The truth that is named counts, also where the session has none or its own.
TEST_F(SolvedSession, IsComparedWithTheTruthThatIsNamed) {
  const auto error_deg = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {Path("dome"), "-o", Path("again"), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const RunResult run = testing::Solve(words);
    EXPECT_EQ(run.exit_status, 0) << run.log;
    const nlohmann::json json = run.Json();
    return json.contains("angular_error_deg") && !json["angular_error_deg"].is_null()
               ? json["angular_error_deg"]["mean"].get<double>()
               : -1.0;
  };
  const double own = error_deg({});
  EXPECT_LT(own, 1e-3);
  EXPECT_GT(error_deg({"--truth", Path("hill")}), 1.0);
  fs::rename(Path("dome/truth"), Path("elsewhere"));
  EXPECT_EQ(error_deg({}), -1.0);
  fs::create_directory(Path("true"));
  fs::rename(Path("elsewhere"), Path("true/truth"));
  EXPECT_NEAR(error_deg({"--truth", Path("true")}), own, 1e-9);
}

}  // namespace
}  // namespace sateen::solved_session_test
