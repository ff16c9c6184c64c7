#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "cli/calibrate/calibrate_response.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::testing {

// Sensor of a camera that sees green best, bends near the top and saturates below its files' white.
inline constexpr const char* kSensor = R"("sensor": {"preset": "nikon-d5100", "black": 600,
    "saturation": 15100, "sensitivity_rgb": [0.52, 1, 0.71], "knee": 0.75, "compression": 0.03,
    "full_scale": 1.2})";
inline constexpr const char* kPatches = R"("texture": {"kind": "patches", "count": 6,
    "values": [0.9, 0.59, 0.36, 0.19, 0.09, 0.03], "patch_mm": 28})";

inline nlohmann::json ReadJson(const std::filesystem::path& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

inline std::string ChartFile() {
  return (std::filesystem::path(testing::SourceDir()) / "samples" / "charts" / "neutral.json")
      .string();
}

inline RunResult CalibrateResponse(std::vector<std::string> words) {
  words.insert(words.begin(), "response");
  return RunCommand<cli::CalibrateResponseArgs>(std::move(words), cli::AddCalibrateResponse,
                                                cli::RunCalibrateResponse);
}

// Simulated sessions under three white LEDs of different colour, for the tests of one suite.
class SimulatedChart : public ::testing::Test {
 protected:
  static void MakeRig() {
    folder_ = new TempFolder();
    nlohmann::json rig = ReadJson(std::filesystem::path(testing::SourceDir()) / "samples" / "rigs" /
                                  "ring10-white-leds.json");
    const nlohmann::json all = rig["lights"];
    rig["lights"] = {all[0], all[3], all[6]};
    WriteText(folder_->Path() / "true.json", rig.dump());
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static void Render(const std::string& name, const std::string& kind, const std::string& material,
                     const std::string& exposure, const std::string& sensor,
                     const std::string& more = "") {
    WriteText(folder_->Path() / (name + ".json"),
              fmt::format(R"({{"schema": "sateen.scene/1", "rig": "true.json", "kind": "{}",
                  "surface": {{"shape": "plane"}}, "materials": {{"surface": {{{}}}}}, {}, {}{}}})",
                          kind, material, exposure, sensor, more));
    const RunResult run = Simulate({Path(name + ".json"), "-o", Path(name)});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] static std::string Path(const std::string& name) {
    return (folder_->Path() / name).string();
  }

  // The rig under `name` with another response, lights and calibration record as they are.
  [[nodiscard]] static RunResult RunOn(const std::string& chart, const std::string& output,
                                       std::vector<std::string> more = {}) {
    more.insert(more.begin(), {Path(chart), "--patches", ChartFile(), "-o", Path(output)});
    return CalibrateResponse(std::move(more));
  }

  inline static TempFolder* folder_ = nullptr;
};

}  // namespace sateen::testing
