#include "cli/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

std::string SampleScene(const std::string& name) {
  return (fs::path(SATEEN_SOURCE_DIR) / "samples" / "scenes" / name).string();
}

TEST(SimulateCommand, EverySampleSceneRenders) {
  const TempFolder folder;
  int scenes = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(SATEEN_SOURCE_DIR) / "samples/scenes")) {
    const fs::path out = folder.Path() / entry.path().stem();
    const RunResult run = Simulate({entry.path().string(), "-o", out.string()});
    EXPECT_EQ(run.exit_status, 0) << run.log;
    EXPECT_TRUE(fs::exists(out / "session.json")) << entry.path();
    EXPECT_TRUE(fs::exists(out / "truth" / "normal.exr")) << entry.path();
    ++scenes;
  }
  EXPECT_GE(scenes, 2);
}

TEST(SimulateCommand, NamesTheKeyThatIsWrong) {
  const TempFolder folder;
  const auto log_of = [&](const std::string& scene) {
    const std::string path = (folder.Path() / "scene.json").string();
    WriteText(path, scene);
    const RunResult run = Simulate({path, "-o", (folder.Path() / "out").string()});
    EXPECT_EQ(run.exit_status, 3) << scene;
    EXPECT_FALSE(fs::exists(folder.Path() / "out"));
    return run.log;
  };
  const std::string head = R"({"schema": "sateen.scene/1", "rig": "rig.json", )";

  EXPECT_THAT(log_of(head + R"("surface": {"shape": "cube"}, "albedo": {"min": 0.1, "max": 1}})"),
              HasSubstr("surface.shape 'cube'; need flat, dome or ripple"));
  EXPECT_THAT(log_of(head + R"("surface": {"shape": "dome", "max_slope_deg": 90},
                               "albedo": {"min": 0.1, "max": 1}})"),
              HasSubstr("surface.max_slope_deg"));
  EXPECT_THAT(log_of(head + R"("surface": {"shape": "flat"}, "albedo": {"min": -0.1, "max": 1}})"),
              HasSubstr("albedo.min"));
  EXPECT_THAT(log_of(head + R"("surface": {"shape": "flat"}, "albedo": {"min": 0.1, "max": 1},
                               "fog": 1})"),
              HasSubstr("fog"));
}

TEST(SimulateCommand, ALightThatNoFileCanBeNamedAfterIsRefused) {
  const TempFolder folder;
  const std::string scene = (folder.Path() / "scene.json").string();
  std::ifstream sample(fs::path(SATEEN_SOURCE_DIR) / "samples" / "rigs" / "ring10.json");
  nlohmann::json rig = nlohmann::json::parse(sample);
  rig["lights"][3]["name"] = "../x";
  WriteText(folder.Path() / "rig.json", rig.dump());
  WriteText(scene, R"({"schema": "sateen.scene/1", "rig": "rig.json",
                       "surface": {"shape": "flat"}, "albedo": {"min": 0.1, "max": 1}})");

  const RunResult run = Simulate({scene, "-o", (folder.Path() / "out").string()});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("\"../x\""));
  EXPECT_FALSE(fs::exists(folder.Path() / "out"));
}

TEST(SimulateCommand, AMissingRigIsNamed) {
  const TempFolder folder;
  const std::string scene = (folder.Path() / "scene.json").string();
  WriteText(scene, R"({"schema": "sateen.scene/1", "rig": "gone.json",
                       "surface": {"shape": "flat"}, "albedo": {"min": 0.1, "max": 1}})");

  const RunResult run = Simulate({scene, "-o", (folder.Path() / "out").string()});

  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr("gone.json"));
}

TEST(SimulateCommand, TheSameSceneGivesTheSameBytes) {
  const TempFolder folder;
  for (const char* threads : {"1", "2"}) {
    const std::string out = (folder.Path() / threads).string();
    ASSERT_EQ(Simulate({SampleScene("dome.json"), "-o", out, "--threads", threads}).exit_status, 0);
  }
  const auto bytes = [&](const char* threads) {
    std::ifstream file(folder.Path() / threads / "session.json");
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(bytes("1"), bytes("2"));  // holds the hash of every frame
}

}  // namespace
}  // namespace sateen
