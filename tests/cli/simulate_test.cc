#include "cli/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "imaging/raw.h"
#include "rig/rig.h"
#include "scanner/sessions/session.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

namespace sateen::simulate_test {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

std::string SampleScene(const std::string& name) {
  return (fs::path(testing::SourceDir()) / "samples" / "scenes" / name).string();
}

TEST(SimulateCommand, ListsEverySampleSceneWithItsTitle) {
  const RunResult run = Simulate({"--list", SampleScene("")});
  EXPECT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.out, HasSubstr("Denim twill under ten LEDs (fabric, 10 lights, 640x480 px)"));
  EXPECT_THAT(run.out, HasSubstr("White paper, flat (sheet"));
  EXPECT_THAT(run.out, Not(HasSubstr("cannot be read")));
  EXPECT_GE(std::count(run.out.begin(), run.out.end(), '\n'), 2 * 20);
  EXPECT_EQ(Simulate({"--list", SampleScene("gone")}).exit_status, 4);
}

// A scene of 160x120 pixels under one ring of ten lights.
class SmallScene {
 public:
  explicit SmallScene(const std::string& rest) {
    std::ifstream sample(fs::path(testing::SourceDir()) / "samples" / "rigs" / "ring10.json");
    nlohmann::json rig = nlohmann::json::parse(sample);
    rig["camera"]["size_px"] = {160, 120};
    rig["camera"]["k"] = {488.0, 488.0, 79.5, 59.5};
    WriteText(folder_.Path() / "rig.json", rig.dump());
    WriteText(folder_.Path() / "scene.json",
              R"({"schema": "sateen.scene/1", "rig": "rig.json", )" + rest + "}");
  }
  [[nodiscard]] RunResult Run(std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {(folder_.Path() / "scene.json").string(), "-o", Out()});
    return Simulate(options);
  }
  [[nodiscard]] std::string Out() const { return (folder_.Path() / "out").string(); }

 private:
  TempFolder folder_;
};

constexpr const char* kFlat = R"("surface": {"shape": "plane"},
  "materials": {"surface": {"texture": {"kind": "waves", "min": 0.2, "max": 0.8,
                                        "period_mm": 400}}})";

TEST(SimulateCommand, WritesTheSessionOfARealScanner) {
  const SmallScene scene(std::string(kFlat) + R"(, "sensor": {"preset": "nikon-d5100"})");
  const RunResult run = scene.Run();
  ASSERT_EQ(run.exit_status, 0) << run.log;
  const fs::path out = scene.Out();
  const Result<Session> session = ReadSession(out);
  ASSERT_TRUE(session) << session.error().message;
  ASSERT_EQ(session->frames.size(), 11U);
  EXPECT_EQ(session->frames[3].file, "frames/led-3.dng");
  EXPECT_EQ(session->frames[10].role, FrameRole::kDark);
  EXPECT_EQ(session->frames[0].exposure_s, 0.02);
  for (const char* name : {"normal.exr", "albedo.exr", "height.exr", "rig.json", "lit/led-9.png"}) {
    EXPECT_TRUE(fs::exists(out / "truth" / name)) << name;
  }
  const Result<RawMosaic> mosaic = ReadRawMosaic(out / "frames/led-0.dng");
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  EXPECT_EQ(mosaic->white, 15892.0F);
  EXPECT_NEAR(*mosaic->exposure_s, 0.02, 1e-6);
  EXPECT_NEAR(*mosaic->f_number, 8.0, 1e-6);
}

// Noise-free 16-bit RAW without shadows: what rounding and demosaicing of a smooth surface leave.
TEST(SimulateCommand, NoiseFreeRawSolvesToTheTruth) {
  const SmallScene scene(kFlat);
  ASSERT_EQ(scene.Run().exit_status, 0);
  const RunResult solved =
      sateen::testing::Solve({scene.Out(), "-o", scene.Out() + "/maps", "--json"});
  ASSERT_EQ(solved.exit_status, 0) << solved.log;
  EXPECT_LT(solved.Json()["angular_error_deg"]["mean"].get<double>(), 0.01);
  EXPECT_LT(solved.Json()["albedo_error"]["mean"].get<double>(), 0.01);
}

TEST(SimulateCommand, LinearFramesSolveToTheTruthExactly) {
  const SmallScene scene(kFlat);
  ASSERT_EQ(scene.Run({"--linear"}).exit_status, 0);
  EXPECT_TRUE(fs::exists(fs::path(scene.Out()) / "frames/led-0.exr"));
  const RunResult solved =
      sateen::testing::Solve({scene.Out(), "-o", scene.Out() + "/maps", "--json"});
  ASSERT_EQ(solved.exit_status, 0) << solved.log;
  EXPECT_LT(solved.Json()["angular_error_deg"]["max"].get<double>(), 1e-4);
  EXPECT_LT(solved.Json()["albedo_error"]["max"].get<double>(), 1e-5);
  // RAW frames of a second run take the place of the first run's.
  ASSERT_EQ(scene.Run().exit_status, 0);
  EXPECT_FALSE(fs::exists(fs::path(scene.Out()) / "frames/led-0.exr"));
}

TEST(SimulateCommand, ErrorsNameTheKeyAndItsRange) {
  const auto log_of = [](const std::string& rest) {
    const SmallScene scene(rest);
    const RunResult run = scene.Run();
    EXPECT_EQ(run.exit_status, 3) << rest;
    EXPECT_FALSE(fs::exists(scene.Out()));
    return run.log;
  };
  const auto flat_with = [&](const std::string& more) {
    return log_of(std::string(kFlat) + ", " + more);
  };
  const auto surface = [&](const std::string& text) {
    return log_of(R"("surface": )" + text + R"(, "materials": {"surface": {"albedo": [1, 1, 1]}})");
  };
  EXPECT_THAT(surface(R"({"shape": "cube"})"), HasSubstr("surface.shape 'cube'; need plane"));
  EXPECT_THAT(surface(R"({"shape": "sphere", "radius_mm": -1, "edge_deg": 40})"),
              HasSubstr("surface.radius_mm = -1; need radius_mm > 0"));
  EXPECT_THAT(surface(R"({"shape": "waves", "period_mm": 5, "max_slope_deg": 90})"),
              HasSubstr("surface.max_slope_deg 90; need 0 to below 90 degrees"));
  EXPECT_THAT(log_of(R"("surface": {"shape": "plane"},
                        "materials": {"surface": {"albedo": [0.5, -0.5, 0.5]}})"),
              HasSubstr("materials.surface.albedo = -0.5; need 0 to 1"));
  EXPECT_THAT(log_of(R"("surface": {"shape": "plane"}, "materials": {"surface": {"albedo":
                        [1, 1, 1], "specular": {"model": "ggx", "f0": 0.04, "alpha": -1}}})"),
              HasSubstr("materials.surface.specular.alpha = -1; need 0.001 to 1"));
  EXPECT_THAT(log_of(R"("surface": {"shape": "plane"}, "materials": {"yarn": {}})"),
              HasSubstr("materials.surface"));
  EXPECT_THAT(flat_with(R"("fog": 1)"), HasSubstr("fog"));
  EXPECT_THAT(flat_with(R"("lens": {"zoom": 1})"),
              HasSubstr("lens.zoom is not known here; the keys are bump, psf_sigma_px, samples, "));
  EXPECT_THAT(flat_with(R"("sensor": {"full_scale": 1e300})"),
              HasSubstr("sensor.full_scale = 1e+300; need 1e-6 to 1e6"));
  EXPECT_THAT(flat_with(R"("sensor": {"read_noise_electrons": 3})"),
              HasSubstr("sensor.read_noise_electrons = 3; need full_well_electrons beside it"));
  EXPECT_THAT(flat_with(R"("illumination": {"ambient_rgb": [1e300, 0, 0]})"),
              HasSubstr("illumination.ambient_rgb = 1e+300; need 0 to 1e6 each"));
  EXPECT_THAT(flat_with(R"("sensor": {"bits": 13})"), HasSubstr("sensor.bits = 13; need 12, 14"));
  EXPECT_THAT(flat_with(R"("sensor": {"bayer": "RGBG"})"), HasSubstr("sensor.bayer 'RGBG'"));
  EXPECT_THAT(flat_with(R"("illumination": {"shadows": "soft"})"),
              HasSubstr("illumination.shadows 'soft'; need none, attached or cast"));
  EXPECT_THAT(flat_with(R"("illumination": {"dead": "led-77"})"),
              HasSubstr("illumination.dead: 'led-77' is no light of the rig"));
  EXPECT_THAT(flat_with(R"("lens": {"bump": {"from": "led-1"}})"), HasSubstr("shift_px"));
  EXPECT_THAT(flat_with(R"("exposure": {"exposure_s": 0, "f_number": 8, "iso": 100})"),
              HasSubstr("exposure.exposure_s 0; need 1e-6 to 1e5"));
  EXPECT_THAT(surface(R"({"shape": "steps", "count": 1, "tread_mm": 5, "rise_mm": 1,
                          "riser_mm": 1e-6})"),
              HasSubstr("surface rises by 1e+06 mm a millimetre somewhere; need at most 100"));
  EXPECT_THAT(log_of(R"("kind": "sheet", "surface": {"shape": "waves", "period_mm": 5,
                        "max_slope_deg": 9}, "materials": {"surface": {"albedo": [1, 1, 1]}})"),
              HasSubstr("surface.shape is no plane, but kind is sheet"));
}

TEST(SimulateCommand, AMissingHeightMapIsNamed) {
  const SmallScene scene(R"("surface": {"shape": "height-map", "file": "gone.exr", "pitch_mm": 1},
                            "materials": {"surface": {"albedo": [1, 1, 1]}})");
  const RunResult run = scene.Run();
  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr("surface.file: "));
}

TEST(SimulateCommand, ALightThatNoFileCanBeNamedAfterIsRefused) {
  const TempFolder folder;
  const std::string scene = (folder.Path() / "scene.json").string();
  std::ifstream sample(fs::path(testing::SourceDir()) / "samples" / "rigs" / "ring10.json");
  nlohmann::json rig = nlohmann::json::parse(sample);
  rig["lights"][3]["name"] = "../x";
  WriteText(folder.Path() / "rig.json", rig.dump());
  WriteText(scene, R"({"schema": "sateen.scene/1", "rig": "rig.json",
                       "surface": {"shape": "plane"},
                       "materials": {"surface": {"albedo": [0.5, 0.5, 0.5]}}})");

  const RunResult run = Simulate({scene, "-o", (folder.Path() / "out").string()});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("\"../x\""));
  EXPECT_FALSE(fs::exists(folder.Path() / "out"));
}

TEST(SimulateCommand, FramesOfLightsThatAreNoMoreDoNotStay) {
  const SmallScene scene(kFlat);
  ASSERT_EQ(scene.Run().exit_status, 0);
  const fs::path out = scene.Out();
  ASSERT_TRUE(fs::exists(out / "frames/led-9.dng"));
  WriteText(out / "frames/mine.txt", "mine");
  std::ifstream file(out.parent_path() / "rig.json");
  nlohmann::json rig = nlohmann::json::parse(file);
  rig["lights"].erase(9);
  WriteText(out.parent_path() / "rig.json", rig.dump());

  ASSERT_EQ(scene.Run().exit_status, 0);

  EXPECT_FALSE(fs::exists(out / "frames/led-9.dng"));
  EXPECT_FALSE(fs::exists(out / "truth/lit/led-9.png"));
  EXPECT_TRUE(fs::exists(out / "frames/led-8.dng"));
  EXPECT_TRUE(fs::exists(out / "frames/mine.txt"));
}

TEST(SimulateCommand, TheFolderOfTheSceneIsNoPlaceForTheSession) {
  const SmallScene scene(kFlat);
  const fs::path folder = fs::path(scene.Out()).parent_path();
  const auto rig_size = fs::file_size(folder / "rig.json");

  const RunResult run = Simulate({(folder / "scene.json").string(), "-o", folder.string()});

  EXPECT_EQ(run.exit_status, 2);
  EXPECT_THAT(run.log, HasSubstr("holds scene.json, which the scene is made of"));
  EXPECT_EQ(fs::file_size(folder / "rig.json"), rig_size);
}

TEST(SimulateCommand, ALightNamedAsTheDarkFrameIsRefused) {
  const SmallScene scene(kFlat);
  std::ifstream sample(fs::path(testing::SourceDir()) / "samples" / "rigs" / "ring10.json");
  nlohmann::json rig = nlohmann::json::parse(sample);
  rig["lights"][3]["name"] = "dark";
  WriteText(fs::path(scene.Out()).parent_path() / "rig.json", rig.dump());

  const RunResult run = scene.Run();

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("is named 'dark', as the dark frame is"));
  EXPECT_FALSE(fs::exists(scene.Out()));
}

// samples/sessions holds a session that was rendered once and kept. Other machines' libm may round
// another way, so a reading may differ by one step, rarely.
TEST(SimulateCommand, TheKeptSessionIsWhatItsSceneGives) {
  const TempFolder folder;
  const fs::path samples = fs::path(testing::SourceDir()) / "samples";
  const fs::path kept = samples / "sessions" / "twill-small";
  const RunResult run = Simulate(
      {(samples / "scenes" / "twill-small.json").string(), "-o", (folder.Path() / "out").string()});
  ASSERT_EQ(run.exit_status, 0) << run.log;

  for (const char* name : {"led-0", "led-9", "dark"}) {
    const fs::path frame = fs::path("frames") / (std::string(name) + ".dng");
    const RawMosaic now = ReadRawMosaic(folder.Path() / "out" / frame).value();
    const RawMosaic then = ReadRawMosaic(kept / frame).value();
    ASSERT_EQ(now.samples.Size(), then.samples.Size());
    size_t differing = 0;
    for (size_t site = 0; site < now.samples.pixels.size(); ++site) {
      const float steps =
          (now.samples.pixels[site] - then.samples.pixels[site]) * (now.white - now.black);
      EXPECT_LT(std::abs(steps), 1.5F);
      differing += std::abs(steps) > 0.5F ? 1 : 0;
    }
    EXPECT_LT(differing, now.samples.pixels.size() / 1000) << name;
  }
}

TEST(SimulateCommand, AMissingRigIsNamed) {
  const TempFolder folder;
  const std::string scene = (folder.Path() / "scene.json").string();
  WriteText(scene, R"({"schema": "sateen.scene/1", "rig": "gone.json",
                       "surface": {"shape": "plane"},
                       "materials": {"surface": {"albedo": [0.5, 0.5, 0.5]}}})");

  const RunResult run = Simulate({scene, "-o", (folder.Path() / "out").string()});

  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr("scene.json: rig: "));
  EXPECT_THAT(run.log, HasSubstr("gone.json"));
}

constexpr const char* kChartSeries = R"(, "kind": "chart",
  "sensor": {"preset": "nikon-d5100", "black": 600, "sensitivity_rgb": [0.5, 1, 0.7],
             "saturation": 15000},
  "exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100, "series_s": [0.005, 0.01, 0.04],
               "series_light": "led-3", "repeats": 2})";

double MeanOf(const fs::path& path) {
  const RawMosaic mosaic = ReadRawMosaic(path).value();
  double sum = 0.0;
  for (const float site : mosaic.samples.pixels) {
    sum += static_cast<double>(site);
  }
  return sum / static_cast<double>(mosaic.samples.pixels.size());
}

TEST(SimulateCommand, AChartMayHaveASeriesOfExposuresInPairs) {
  const SmallScene scene(std::string(kFlat) + kChartSeries);
  const RunResult run = scene.Run();
  ASSERT_EQ(run.exit_status, 0) << run.log;
  const fs::path out = scene.Out();
  const Session session = ReadSession(out).value();
  ASSERT_EQ(session.frames.size(), 9U * 2U + 3U * 2U + 2U * 2U);
  EXPECT_EQ(session.frames[6].file, "frames/led-3-0.005s-1.dng");
  EXPECT_EQ(session.frames[6].exposure_s, 0.005);
  EXPECT_EQ(session.frames[5].file, "frames/led-2-0.02s-2.dng");
  EXPECT_EQ(session.frames.back().file, "frames/dark-0.04s-2.dng");
  // As bright as the time says; the same light, another noise.
  const double one = MeanOf(out / "frames/led-3-0.005s-1.dng");
  EXPECT_NEAR(MeanOf(out / "frames/led-3-0.01s-1.dng") / one, 2.0, 0.01);
  EXPECT_NEAR(MeanOf(out / "frames/led-3-0.005s-2.dng") / one, 1.0, 0.005);
  EXPECT_NE(ReadRawMosaic(out / "frames/led-3-0.005s-1.dng")->samples.pixels,
            ReadRawMosaic(out / "frames/led-3-0.005s-2.dng")->samples.pixels);
  // The response, which the chart is to tell, is only in the truth; fluxes are as the sensor sees
  // them.
  EXPECT_FALSE(ReadRig(out / "rig.json")->response);
  const Rig truth = ReadRig(out / "truth/rig.json").value();
  EXPECT_EQ(truth.response->white, 15000.0);
  EXPECT_NEAR(truth.lights[0].flux_rgb[0] / truth.lights[0].flux_rgb[1], 0.5, 1e-12);
}

TEST(SimulateCommand, ASeriesIsOfChartsInRawFilesAlone) {
  const auto log_of = [](const std::string& rest, std::vector<std::string> options = {}) {
    const SmallScene scene(std::string(kFlat) + rest);
    const RunResult run = scene.Run(std::move(options));
    EXPECT_NE(run.exit_status, 0);
    EXPECT_FALSE(fs::exists(scene.Out()));
    return run.log;
  };
  const auto exposure = [](const std::string& kind, const std::string& more) {
    return R"(, "kind": ")" + kind +
           R"(", "exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100, )" + more + "}";
  };
  EXPECT_THAT(log_of(exposure("fabric", R"("repeats": 2)")),
              HasSubstr("exposure.repeats is for kind chart alone"));
  EXPECT_THAT(log_of(exposure("sheet", R"("series_s": [0.01, 0.02])")),
              HasSubstr("exposure.series_s is for kind chart alone"));
  EXPECT_THAT(log_of(exposure("chart", R"("series_s": [])")),
              HasSubstr("an array of finite numbers, at least one"));
  EXPECT_THAT(log_of(exposure("chart", R"("series_s": [0])")), HasSubstr("need 1e-6 to 1e5 each"));
  EXPECT_THAT(log_of(exposure("chart", R"("repeats": 0)")), HasSubstr("repeats 0; need 1 to 100"));
  EXPECT_THAT(log_of(exposure("chart", R"("series_light": "led-77")")),
              HasSubstr("exposure.series_light is 'led-77', which the rig has not"));
  EXPECT_THAT(log_of(exposure("chart", R"("repeats": 2)"), {"--linear"}),
              HasSubstr("exposure.repeats is of RAW frames"));
}

TEST(SimulateCommand, TheSameSceneGivesTheSameBytes) {
  const TempFolder folder;
  for (const char* threads : {"1", "2"}) {
    const std::string out = (folder.Path() / threads).string();
    ASSERT_EQ(Simulate({SampleScene("ripple.json"), "-o", out, "--threads", threads}).exit_status,
              0);
  }
  const auto bytes = [&](const char* threads) {
    std::ifstream file(folder.Path() / threads / "session.json");
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(bytes("1"), bytes("2"));  // holds the hash of every frame
}

}  // namespace
}  // namespace sateen::simulate_test
