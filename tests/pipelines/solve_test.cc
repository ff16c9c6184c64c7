#include "pipelines/solve/solve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/files/file_io.h"
#include "pipelines/simulate/simulate.h"
#include "rig/pixel_pitch.h"
#include "rig/projection.h"
#include "simulation/rigs.h"
#include "tests/testing/files.h"

namespace sateen::solve_pipeline_test {
namespace {

using nlohmann::json;
using testing::TempFolder;
using testing::WriteText;

constexpr const char* kScene = R"({
  "schema": "sateen.scene/1", "rig": "rig.json",
  "surface": {"shape": "plane"},
  "materials": {"surface": {"albedo": [0.6, 0.5, 0.4]}}})";

// Ten near lights under a camera whose fx and fy differ, with its principal point off the middle, a
// tilt and a lens that distorts.
Rig UnevenRig() {
  Rig rig = RingRig({49, 33}, LightModel::kNear, 200.0);
  Camera& camera = *rig.camera;
  camera.fx *= 0.9;
  camera.fy *= 1.2;
  camera.cx += 5.0;
  camera.cy -= 3.0;
  camera.distortion = {0.05, -0.01, 0.002, -0.001, 0.0};
  camera.table_from_camera.rotate(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitX()));
  return rig;
}

// The pixels per metre of a PNG's pHYs chunk, x and y; zero where it has none.
std::array<uint32_t, 2> PixelsPerMetre(const std::filesystem::path& path) {
  const std::string bytes = ReadFileBytes(path).value();
  const size_t at = bytes.find("pHYs");
  if (at == std::string::npos || bytes[at + 12] != 1) {  // 1: the unit is the metre
    return {0, 0};
  }
  const auto word = [&](size_t from) {
    uint32_t value = 0;
    for (size_t k = 0; k < 4; ++k) {
      value = value << 8 | static_cast<uint8_t>(bytes[from + k]);
    }
    return value;
  };
  return {word(at + 4), word(at + 8)};
}

class SolvePipeline : public ::testing::Test {
 protected:
  void SetUp() override { Simulate(UnevenRig()); }

  void Simulate(const Rig& rig) const {
    WriteText(Path("rig.json"), RigToJson(rig));
    WriteText(Path("scene.json"), kScene);
    const Result<SceneFile> scene = SimulateSession({.scene = Path("scene.json"),
                                                     .output = Path("session"),
                                                     .format = FrameFormat::kLinearExr});
    ASSERT_TRUE(scene) << scene.error().message;
  }
  [[nodiscard]] std::filesystem::path Path(const std::string& name) const {
    return folder_.Path() / name;
  }
  [[nodiscard]] SolveOutcome Solve(SolveOptions options) const {
    options.capture = Path("session");
    options.output = Path("maps");
    Result<SolveOutcome> outcome = SolveSession(options);
    EXPECT_TRUE(outcome) << outcome.error().message;
    return *std::move(outcome);
  }
  void ExpectPixelSize(const SolveOptions& options, double pixel_mm) const {
    const SolveOutcome outcome = Solve(options);
    EXPECT_NEAR(json::parse(outcome.report).at("pixel_mm").get<double>(), pixel_mm, 1e-9);
    const auto per_metre = static_cast<uint32_t>(std::lround(1000.0 / pixel_mm));
    EXPECT_EQ(PixelsPerMetre(Path("maps/normal.png")), (std::array{per_metre, per_metre}));
  }

 private:
  TempFolder folder_;
};

TEST_F(SolvePipeline, TheReportIsSolveJson) {
  const SolveOutcome outcome = Solve({});
  EXPECT_EQ(outcome.report + "\n", ReadFileBytes(Path("maps/solve.json")).value());
  EXPECT_EQ(outcome.field.summary.solved, 49 * 33);
  ASSERT_TRUE(outcome.evaluation.angular_error_deg);
  EXPECT_LT(outcome.evaluation.angular_error_deg->max, 1e-3);  // noiseless
}

TEST_F(SolvePipeline, MapsTellTheSizeOfAPixel) {
  ExpectPixelSize({}, PixelPitchMm(*UnevenRig().camera).value());
}

TEST_F(SolvePipeline, PixelsOfUndistortedMapsAreThePinholes) {
  const double pinhole_mm = PixelPitchMm(PinholeOf(*UnevenRig().camera)).value();
  ASSERT_GT(std::abs(pinhole_mm - PixelPitchMm(*UnevenRig().camera).value()), 1e-4);
  ExpectPixelSize({.undistort = true}, pinhole_mm);
}

TEST_F(SolvePipeline, PixelsOfARaisedSurfaceAreSmaller) {
  const Rig lifted = Lifted(UnevenRig(), 20.0).value();
  ASSERT_LT(PixelPitchMm(*lifted.camera).value(), PixelPitchMm(*UnevenRig().camera).value() - 1e-3);
  ExpectPixelSize({.height_mm = 20.0}, PixelPitchMm(*lifted.camera).value());
}

TEST_F(SolvePipeline, WithoutACameraThereIsNoPixelSize) {
  Rig rig = UnevenRig();
  for (Light& light : rig.lights) {
    light = {.name = light.name,
             .channel = light.channel,
             .direction = light.position_mm.normalized(),
             .flux_rgb = light.flux_rgb};
  }
  rig.camera.reset();
  WriteText(Path("no-camera.json"), RigToJson(rig));

  const SolveOutcome outcome = Solve({.rig_file = Path("no-camera.json")});

  EXPECT_FALSE(json::parse(outcome.report).contains("pixel_mm"));
  EXPECT_EQ(PixelsPerMetre(Path("maps/normal.png")), (std::array<uint32_t, 2>{0, 0}));
}

TEST_F(SolvePipeline, WarningsAreToldAtOnceAndKept) {
  std::vector<std::string> told;
  Rig rig = UnevenRig();
  rig.lights[0].position_mm.x() += 200.0;  // as of another rig
  WriteText(Path("other.json"), RigToJson(rig));
  SolveOptions options{.capture = Path("session"), .output = Path("maps")};
  options.rig_file = Path("other.json");

  const Result<SolveOutcome> outcome =
      SolveSession(options, {}, [&](const std::string& warning) { told.push_back(warning); });

  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_EQ(told, outcome->dataset.warnings);
  EXPECT_FALSE(told.empty());
}

TEST(Passed, NoNumberIsNotWithinALimit) {
  SolveOptions options;
  Evaluation evaluation;
  EXPECT_TRUE(Passed(options, evaluation));
  options.fail_above_deg = 2.0;
  EXPECT_FALSE(Passed(options, evaluation));
  evaluation.angular_error_deg = ErrorStatistics{.count = 1, .mean = 2.0};
  EXPECT_TRUE(Passed(options, evaluation));
  evaluation.angular_error_deg->mean = std::nextafter(2.0, 3.0);
  EXPECT_FALSE(Passed(options, evaluation));
  evaluation.angular_error_deg->mean = std::nan("");
  EXPECT_FALSE(Passed(options, evaluation));
}

}  // namespace
}  // namespace sateen::solve_pipeline_test
