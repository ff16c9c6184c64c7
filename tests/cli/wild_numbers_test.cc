#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/files/file_io.h"
#include "imaging/image_io.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

// Each number of a rig, a session and a scene is in turn one that no hand meant to write. Whoever
// reads it fails and names the key, or gives finite maps. SATEEN_WILD=all tries each value at each
// number; otherwise the values take turns.
namespace sateen::wild_numbers_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::RunResult;

constexpr const char* kRig = R"({
  "schema": "sateen.rig/1",
  "camera": {"model": "test", "size_px": [64, 64], "k": [195.0, 195.0, 31.5, 31.5],
             "distortion": [0.01, 0.001, 0.0001, 0.0001, 0.0001],
             "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 610, 0, 0, 0, 1]},
  "response": {"black": 600, "white": 15892, "white_balance": [1.5, 1, 1.2],
               "read_noise_dn": 1.6, "gain_dn_per_electron": 0.33},
  "lights": [
    {"name": "a", "channel": 0, "model": "near", "position_mm": [424, 0, 424],
     "position_sd_mm": [1, 1, 1], "flux_rgb": [900, 900, 900]},
    {"name": "b", "channel": 1, "model": "led", "position_mm": [0, 424, 424],
     "axis": [0, -0.70710678, -0.70710678], "anisotropy": 1.5, "flux_rgb": [900, 900, 900]},
    {"name": "c", "channel": 2, "model": "led+field", "position_mm": [-424, 0, 424],
     "axis": [0.70710678, 0, -0.70710678], "anisotropy": 1.5, "flux_rgb": [900, 900, 900],
     "field": {"origin_mm": [-300, -300], "spacing_mm": 200, "columns": 4, "rows": 4,
               "gain": [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]}},
    {"name": "d", "channel": 3, "model": "distant", "direction": [0, -0.6, 0.8],
     "direction_sd_deg": 0.5, "irradiance_sd": 0.01, "flux_rgb": [1.2, 1.2, 1.2]}]
})";

constexpr const char* kScene = R"({
  "schema": "sateen.scene/1", "rig": "rig.json",
  "surface": {"shape": "waves", "period_mm": 60, "max_slope_deg": 15},
  "materials": {"surface": {"albedo": [0.5, 0.4, 0.3],
                            "specular": {"model": "ggx", "f0": 0.04, "alpha": 0.4}}},
  "sensor": {"preset": "nikon-d5100", "black": 600, "full_scale": 4.0}
})";

const std::vector<json> kWild = {0,
                                 -1,
                                 1e-300,
                                 1e30,
                                 1e308,
                                 -1e30,
                                 2147483647,
                                 -2147483648LL,
                                 9223372036854775807LL,
                                 18446744073709551615ULL,
                                 0.5,
                                 "1",
                                 nullptr,
                                 json::array({json::array({1})}),
                                 json::object()};

std::vector<json::json_pointer> NumbersOf(const json& file) {
  std::vector<json::json_pointer> places;
  const json flat = file.flatten();
  for (const auto& [path, value] : flat.items()) {
    if (value.is_number()) {
      places.emplace_back(path);
    }
  }
  return places;
}

// Returns the key that holds the number, itself or in an array.
std::string KeyOf(json::json_pointer place) {
  while (!place.empty() && place.back().find_first_not_of("0123456789") == std::string::npos) {
    place.pop_back();
  }
  return place.back();
}

class WildNumbers : public ::testing::Test {
 protected:
  [[nodiscard]] fs::path Path(const std::string& name) const { return folder_.Path() / name; }

  void SetUp() override {
    testing::WriteText(Path("rig.json"), kRig);
    testing::WriteText(Path("scene.json"), kScene);
    const RunResult made = testing::Simulate({Path("scene.json"), "-o", Path("session")});
    ASSERT_EQ(made.exit_status, 0) << made.log;
  }

  // Runs `use` with each number of the file changed, and puts the file back.
  template <typename Use>
  void TryEachNumber(const fs::path& path, const Use& use) {
    const std::string text = *ReadFileBytes(path);
    const json file = json::parse(text);
    const bool all = std::getenv("SATEEN_WILD") != nullptr;  // NOLINT(concurrency-mt-unsafe)
    size_t turn = 0;
    for (const json::json_pointer& place : NumbersOf(file)) {
      for (size_t k = 0; k < (all ? kWild.size() : 2); ++k) {
        json changed = file;
        changed[place] = kWild[all ? k : turn++ % kWild.size()];
        testing::WriteText(path, changed.dump());
        SCOPED_TRACE(place.to_string() + " = " + changed[place].dump());
        use(KeyOf(place));
      }
    }
    testing::WriteText(path, text);
  }

  // Fails unless the run told an error that names the key. A lens that fits no pose is "the camera".
  static void ExpectNamed(const RunResult& run, const std::string& key) {
    EXPECT_THAT(run.exit_status, ::testing::AnyOf(2, 3, 4)) << run.log;
    const bool of_camera = key == "k" || key == "distortion" || key == "table_from_camera";
    EXPECT_THAT(run.log, ::testing::HasSubstr(of_camera ? "camera" : key));
  }

  void ExpectSolvedOrNamed(const std::string& key) const {
    const RunResult run =
        testing::Solve({Path("session"), "-o", Path("maps"), "--rig", Path("rig.json"), "--threads",
                        "1", "--robust", "least-squares"});
    if (run.exit_status != 0) {
      ExpectNamed(run, key);
      return;
    }
    for (const char* map : {"normal.exr", "albedo.exr"}) {
      const Result<Image3> image = ReadImage3(Path("maps") / map);
      ASSERT_TRUE(image) << image.error().message;
      for (size_t c = 0; c < 3; ++c) {
        for (const float value : (*image)[c].pixels) {
          ASSERT_TRUE(std::isfinite(value)) << map;
        }
      }
    }
  }

  testing::TempFolder folder_;
};

TEST_F(WildNumbers, OfARigAreNamedOrSolveFinitely) {
  TryEachNumber(Path("rig.json"), [&](const std::string& key) { ExpectSolvedOrNamed(key); });
}

TEST_F(WildNumbers, OfASessionAreNamedOrSolveFinitely) {
  TryEachNumber(Path("session") / "session.json",
                [&](const std::string& key) { ExpectSolvedOrNamed(key); });
}

TEST_F(WildNumbers, OfASceneAreNamedOrSimulate) {
  TryEachNumber(Path("scene.json"), [&](const std::string& key) {
    const RunResult run =
        testing::Simulate({Path("scene.json"), "-o", Path("other"), "--threads", "1"});
    if (run.exit_status != 0) {
      ExpectNamed(run, key);
    }
    fs::remove_all(Path("other"));
  });
}

}  // namespace
}  // namespace sateen::wild_numbers_test
