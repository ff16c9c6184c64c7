#include "cli/calibrate/calibrate_spheres.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "imaging/image_io.h"
#include "rig/rig.h"
#include "tests/calibration/synthetic_spheres.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen::calibrate_spheres_test {
namespace {

using sateen::testing::AngleDeg;
using sateen::testing::RenderSpheres;
using sateen::testing::RunResult;
using sateen::testing::Solve;
using sateen::testing::SphereCamera;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

const std::vector<Eigen::Vector3d>& Lamps() {
  static const std::vector<Eigen::Vector3d> lamps = {
      {250, 100, 500}, {-400, 50, 300}, {60, -300, 450}, {-100, 280, 520}};
  return lamps;
}

RunResult CalibrateSpheres(std::vector<std::string> words) {
  words.insert(words.begin(), "spheres");
  return sateen::testing::RunCommand<cli::CalibrateSpheresArgs>(
      std::move(words), cli::AddCalibrateSpheres, cli::RunCalibrateSpheres);
}

void WriteFrame(const fs::path& path, const Image<float>& gray) {
  std::array<Image<uint16_t>, 3> planes;
  planes.fill(Image<uint16_t>(gray.Size()));
  for (size_t p = 0; p < gray.pixels.size(); ++p) {
    planes[0].pixels[p] = static_cast<uint16_t>(std::lround(65535.0F * gray.pixels[p]));
  }
  planes[1] = planes[2] = planes[0];
  ASSERT_TRUE(WritePng16(path, planes));
}

std::string TextOf(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Four photographs of two spheres, one a lamp, a picture by room light and the camera's rig, once.
class CalibrateSpheresCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder();
    fs::create_directories(Shared("photos"));
    WriteFrame(Shared("photos/ref.png"), RenderSpheres({}));
    for (size_t k = 0; k < Lamps().size(); ++k) {
      WriteFrame(Shared(fmt::format("photos/lamp-{}.png", k)), RenderSpheres({Lamps()[k]}, 4.0));
    }
    Rig rig;
    rig.camera = SphereCamera();
    rig.camera->model = "simulated";
    rig.lights.resize(1);
    rig.lights[0] = {.name = "lamp-2",
                     .channel = 7,
                     .model = LightModel::kNear,
                     .position_mm = {0, 0, 100},
                     .flux_rgb = {2, 3, 4}};
    WriteText(Shared("rig.json"), RigToJson(rig));
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  [[nodiscard]] static std::string Shared(const std::string& name) {
    return (shared_->Path() / name).string();
  }
  [[nodiscard]] std::string Own(const std::string& name) const {
    return (own_.Path() / name).string();
  }

  // Exit status 3, a message that names it, and the old output as it was.
  void ExpectRefused(std::vector<std::string> words, const std::string& why) const {
    WriteText(Own("lights.json"), "old");
    words.insert(words.end(), {"-o", Own("lights.json")});
    const RunResult run = CalibrateSpheres(words);
    EXPECT_EQ(run.exit_status, 3) << run.log;
    EXPECT_THAT(run.log, HasSubstr(why));
    EXPECT_EQ(TextOf(Own("lights.json")), "old");
    EXPECT_FALSE(fs::exists(Own("lights-spheres")));
  }

  // A copy of the photographs whose frame `name` is another.
  [[nodiscard]] std::string PhotosWith(const std::string& name, const Image<float>& frame) const {
    fs::copy(Shared("photos"), Own("photos"),
             fs::copy_options::overwrite_existing | fs::copy_options::recursive);
    WriteFrame(Own("photos/" + name), frame);
    return Own("photos");
  }

  static TempFolder* shared_;
  TempFolder own_;
};
TempFolder* CalibrateSpheresCommand::shared_ = nullptr;

TEST_F(CalibrateSpheresCommand, PositionsThatSolveReads) {
  const RunResult run = CalibrateSpheres({Shared("photos"), "-o", Own("lights.json"), "--rig",
                                          Shared("rig.json"), "--radius", "30", "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const Rig rig = ReadRig(Own("lights.json")).value();
  ASSERT_EQ(rig.lights.size(), Lamps().size());
  for (size_t k = 0; k < Lamps().size(); ++k) {
    EXPECT_EQ(rig.lights[k].name, fmt::format("lamp-{}", k));
    EXPECT_LT((rig.lights[k].position_mm - Lamps()[k]).norm(), 2.0) << k;  // 0.05 deg at 500 mm
  }
  EXPECT_EQ(rig.lights[2].channel, 7);
  EXPECT_EQ(rig.lights[2].flux_rgb, Eigen::Vector3d(2, 3, 4));
  EXPECT_EQ(rig.lights[1].flux_rgb, Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(run.Json()["schema"], "sateen.calibrate.spheres/1");
  EXPECT_EQ(run.Json()["spheres"].size(), 2);
  EXPECT_TRUE(rig.calibration.spheres.value().inputs.value().contains(Shared("photos/ref.png")));
  for (const char* picture : {"outlines.png", "polar.png"}) {
    EXPECT_TRUE(fs::exists(own_.Path() / "lights-spheres" / picture)) << picture;
  }

  const RunResult solved =
      Solve({Shared("photos"), "--rig", Own("lights.json"), "-o", Own("maps"), "--json"});
  ASSERT_EQ(solved.exit_status, 0) << solved.log;
  EXPECT_EQ(solved.Json()["layout"], "photographs");
  EXPECT_EQ(solved.Json()["lights"], 4);
}

TEST_F(CalibrateSpheresCommand, KeepsTheFormerFileAndTheSameBitsForAnyThreads) {
  const std::vector<std::string> words = {Shared("photos"),   "--rig",    Shared("rig.json"),
                                          "--radius",         "30",       "-o",
                                          Own("lights.json"), "--threads"};
  std::array<std::string, 2> threads = {"1", "5"};
  std::array<Lights, 2> lights;
  for (size_t i = 0; i < 2; ++i) {
    std::vector<std::string> all = words;
    all.push_back(threads[i]);
    const RunResult run = CalibrateSpheres(all);
    ASSERT_EQ(run.exit_status, 0) << run.log;
    EXPECT_THAT(run.out, i == 0 ? ::testing::Matcher<std::string>(Not(HasSubstr("is kept as")))
                                : HasSubstr("the previous file is kept as " + Own("lights-20")));
    lights[i] = ReadRig(Own("lights.json"))->lights;
  }
  for (size_t k = 0; k < lights[0].size(); ++k) {
    EXPECT_EQ(lights[0][k].position_mm, lights[1][k].position_mm) << k;
  }
}

// The camera alone, without the radius, gives directions; no camera costs degrees and says so.
TEST_F(CalibrateSpheresCommand, DirectionsAndLpList) {
  const RunResult flat = CalibrateSpheres({Shared("photos"), "-o", Own("lights.lp")});
  ASSERT_EQ(flat.exit_status, 0) << flat.log;
  EXPECT_THAT(flat.log, HasSubstr("no camera is known: the view is taken as orthographic"));
  EXPECT_THAT(flat.log, HasSubstr("lamp-1.png: the spheres' directions differ from their mean"));
  fs::copy_file(Own("lights.lp"), Shared("photos/lights.lp"));
  const RunResult solved = Solve({Shared("photos/lights.lp"), "-o", Own("maps")});
  EXPECT_EQ(solved.exit_status, 0) << solved.log;
  fs::remove(Shared("photos/lights.lp"));

  const RunResult seen =
      CalibrateSpheres({Shared("photos"), "--rig", Shared("rig.json"), "-o", Own("lights.json")});
  ASSERT_EQ(seen.exit_status, 0) << seen.log;
  EXPECT_THAT(seen.log, Not(HasSubstr("orthographic")));
  const Lights lights = ReadRig(Own("lights.json"))->lights;
  for (size_t k = 0; k < Lamps().size(); ++k) {  // the mean over spheres left and right
    EXPECT_EQ(lights[k].model, LightModel::kDistant);
    EXPECT_LT(AngleDeg(lights[k].direction, Lamps()[k] - Eigen::Vector3d(2.5, -2.5, 30)), 2.0) << k;
  }
}

TEST_F(CalibrateSpheresCommand, CirclesByHandInBothForms) {
  const RunResult found = CalibrateSpheres({Shared("photos"), "-o", Own("found.json"), "--json"});
  ASSERT_EQ(found.exit_status, 0) << found.log;
  std::string rows;
  std::string columns;
  const nlohmann::json report = found.Json();
  for (const nlohmann::json& sphere : report["spheres"]) {
    const double x = sphere["center_px"][0];
    const double y = sphere["center_px"][1];
    const double r = sphere["radius_px"];
    rows += fmt::format("{} {} {}\n", x, y, r);
    columns += fmt::format("{}\n{}\n{}\n", x + 1.0, 1000.0 - y, r);
  }
  for (const std::string& text : {rows, columns}) {
    WriteText(Own("circles.txt"), text);
    const RunResult given = CalibrateSpheres(
        {Shared("photos"), "--circles", Own("circles.txt"), "-o", Own("given.json"), "--json"});
    ASSERT_EQ(given.exit_status, 0) << given.log;
    const nlohmann::json again = given.Json();
    for (size_t k = 0; k < Lamps().size(); ++k) {
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(again["lights"][k]["direction"][axis].get<double>(),
                    report["lights"][k]["direction"][axis].get<double>(), 1e-4);
      }
    }
  }
  WriteText(Own("circles.txt"), "1450 500 150\n");
  ExpectRefused({Shared("photos"), "--circles", Own("circles.txt")},
                "circles.txt: the sphere at (1450, 500) px of radius 150 px is cut by the frame");
  WriteText(Own("circles.txt"), "1 2\n");
  ExpectRefused({Shared("photos"), "--circles", Own("circles.txt")}, "circles.txt:1: found 2");
}

TEST_F(CalibrateSpheresCommand, BadPhotographsAreNamed) {
  ExpectRefused({PhotosWith("lamp-1.png", RenderSpheres({}))},
                "lamp-1.png: no highlight in the sphere at");
  ExpectRefused({PhotosWith("lamp-1.png", RenderSpheres({Lamps()[0], Lamps()[1]}))},
                "lamp-1.png: two highlights alike in one sphere");
  ExpectRefused({PhotosWith("lamp-1.png", RenderSpheres({{-500, 0, -260}}, 4.0))},
                "lamp-1.png: the lamp lies behind the spheres");
  ExpectRefused({PhotosWith("ref.png", Image<float>({1500, 1000}, 0.2F))},
                "ref.png: 0 of 1 spheres stand out");
  ExpectRefused({PhotosWith("ref.png", RenderSpheres({})), "--spheres", "3"},
                "ref.png: 2 of 3 spheres stand out");
  ExpectRefused({PhotosWith("lamp-1.png", Image<float>({900, 600}, 0.2F))}, "lamp-1.png");

  const RunResult no_camera =
      CalibrateSpheres({Shared("photos"), "--radius", "30", "-o", Own("lights.json")});
  EXPECT_EQ(no_camera.exit_status, 2);
  EXPECT_THAT(no_camera.log, HasSubstr("--radius 30 without a camera gives no positions"));

  const RunResult twice = CalibrateSpheres(
      {PhotosWith("lamp-1.png", RenderSpheres({Lamps()[0]}, 4.0)), "-o", Own("lights.json")});
  EXPECT_EQ(twice.exit_status, 0);
  EXPECT_THAT(twice.log, HasSubstr("lamp-0.png and lamp-1.png show lamps only"));
}

}  // namespace
}  // namespace sateen::calibrate_spheres_test
