#include "cli/calibrate_response.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "cli/calibrate_lights.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"

namespace sateen {
namespace {

using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::Solve;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

// Of a camera that sees green best, bends near the top and saturates below its files' white.
constexpr const char* kSensor = R"("sensor": {"preset": "nikon-d5100", "black": 600,
    "saturation": 15100, "sensitivity_rgb": [0.52, 1, 0.71], "knee": 0.75, "compression": 0.03,
    "full_scale": 1.2})";
constexpr const char* kSeries = R"("exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100,
    "series_s": [0.00125, 0.005, 0.01, 0.02, 0.025, 0.031, 0.039, 0.049, 0.061, 0.076, 0.1, 0.13],
    "series_light": "led-0", "repeats": 2})";
constexpr const char* kPatches = R"("texture": {"kind": "patches", "count": 6,
    "values": [0.9, 0.59, 0.36, 0.19, 0.09, 0.03], "patch_mm": 28})";

// The same exposed so that white paper stays where it is linear.
std::string Dimmer(std::string sensor) {
  const std::string full_scale = R"("full_scale": 1.2)";
  return sensor.replace(sensor.find(full_scale), full_scale.size(), R"("full_scale": 2)");
}

nlohmann::json ReadJson(const fs::path& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

const std::string kChartFile =
    (fs::path(SATEEN_SOURCE_DIR) / "samples" / "charts" / "neutral.json").string();

RunResult CalibrateResponse(std::vector<std::string> words) {
  words.insert(words.begin(), "response");
  return sateen::testing::RunCommand<cli::CalibrateResponseArgs>(
      std::move(words), cli::AddCalibrateResponse, cli::RunCalibrateResponse);
}

// A chart under three white LEDs of different colour, rendered once.
class CalibrateResponseCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder();
    nlohmann::json rig =
        ReadJson(fs::path(SATEEN_SOURCE_DIR) / "samples" / "rigs" / "ring10-white-leds.json");
    const nlohmann::json all = rig["lights"];
    rig["lights"] = {all[0], all[3], all[6]};
    WriteText(folder_->Path() / "true.json", rig.dump());
    Render("chart", "chart", kPatches, kSeries, kSensor);
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
    more.insert(more.begin(), {Path(chart), "--patches", kChartFile, "-o", Path(output)});
    return CalibrateResponse(std::move(more));
  }

  // A copy of the chart's session with its record changed.
  template <typename Change>
  [[nodiscard]] static std::string Spoilt(const std::string& name, const Change& change) {
    fs::copy(Path("chart"), Path(name), fs::copy_options::recursive);
    nlohmann::json session = ReadJson(fs::path(Path(name)) / "session.json");
    change(session);
    WriteText(fs::path(Path(name)) / "session.json", session.dump());
    return name;
  }

  static void ExpectError(const std::string& chart, const std::string& message) {
    const RunResult run = RunOn(chart, "bad.json");
    EXPECT_EQ(run.exit_status, 3) << chart;
    EXPECT_THAT(run.log, HasSubstr(message)) << chart;
    EXPECT_FALSE(fs::exists(Path("bad.json")));
    EXPECT_FALSE(fs::exists(Path("bad-response")));
  }

  static TempFolder* folder_;
};

TempFolder* CalibrateResponseCommand::folder_ = nullptr;

// The bars of the issue.
TEST_F(CalibrateResponseCommand, MeetsItsBarsOnASimulatedChart) {
  const RunResult run = RunOn("chart", "rig.json", {"--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  const nlohmann::json& error = json.at("error");
  fmt::print(
      "white balance {:.3f} % off at most (bar 0.2), gain {:.2f} % (2), read noise {:.2f} % (5), "
      "saturation {:.3f} % (0.5)\n",
      100.0 * error.at("white_balance").get<double>(), 100.0 * error.at("gain").get<double>(),
      100.0 * error.at("read_noise").get<double>(), 100.0 * error.at("saturation").get<double>());
  EXPECT_LT(error.at("white_balance"), 0.002);
  EXPECT_LT(error.at("gain"), 0.02);
  EXPECT_LT(error.at("read_noise"), 0.05);
  EXPECT_LT(error.at("saturation"), 0.005);
  EXPECT_NEAR(json.at("black_dn"), 600.0, 0.1);
  // -0.03 d^2 = -0.01 x, d = (x - 0.75) / 0.25, is left at x = 0.8841, which reads as 0.8753.
  const double departs_dn = 600.0 + 15292.0 * 0.8753;
  for (const char* colour : {"red", "green", "blue"}) {
    const nlohmann::json& channel = json.at("linearity").at(colour);
    fmt::print("{}: linear within 1 % from {:.0f} to {:.0f} DN (true: {:.0f}), saturated from {}\n",
               colour, channel.at("from_dn").get<double>(), channel.at("to_dn").get<double>(),
               departs_dn, channel.at("saturation_dn").dump());
    // No further than it is true; to within 1 % where a patch lies beyond.
    EXPECT_LT(channel.at("to_dn"), 1.01 * departs_dn);
    EXPECT_GT(channel.at("to_dn"), (channel.at("departs") ? 0.99 : 0.9) * departs_dn);
    EXPECT_LT(channel.at("from_dn"), 660.0);
    EXPECT_EQ(channel.at("saturation_dn"), 15100.0);
  }
  EXPECT_NEAR(json.at("white_dn"), departs_dn, 0.01 * departs_dn);
  EXPECT_EQ(json.at("lights").size(), 3U);
  for (const char* picture : {"linearity.svg", "photon-transfer.svg", "patches.png"}) {
    EXPECT_TRUE(fs::exists(fs::path(Path("rig-response")) / picture)) << picture;
  }
}

TEST_F(CalibrateResponseCommand, TheRigIsWhatTheReportSays) {
  const nlohmann::json json = RunOn("chart", "kept.json", {"--json"}).Json();
  const Rig rig = ReadRig(Path("kept.json")).value();
  ASSERT_TRUE(rig.response);
  EXPECT_EQ(rig.response->white, json.at("white_dn").get<double>());
  EXPECT_EQ(rig.response->black, json.at("black_dn").get<double>());
  EXPECT_EQ(rig.response->white_balance[0], json.at("white_balance")[0].get<double>());
  EXPECT_EQ(*rig.response->gain_dn_per_electron,
            json.at("noise").at("gain_dn_per_electron").get<double>());
  const nlohmann::json record = nlohmann::json::parse(rig.calibration_json).at("response");
  EXPECT_THAT(record.at("inputs").dump(), HasSubstr("chart/frames/led-3-0.02s-1.dng"));
  EXPECT_THAT(record.at("inputs").dump(), HasSubstr("neutral.json"));
  EXPECT_EQ(json.at("former_rig"), "");
  // Text, over the rig just written: that one is kept.
  const RunResult again = RunOn("chart", "kept.json");
  EXPECT_THAT(again.out, HasSubstr("the former rig is kept as"));
  EXPECT_THAT(again.out, HasSubstr("error against truth/rig.json: white balance"));
}

TEST_F(CalibrateResponseCommand, SameFiguresOnAnyNumberOfThreads) {
  nlohmann::json one = RunOn("chart", "t1.json", {"--json", "--threads", "1"}).Json();
  nlohmann::json two = RunOn("chart", "t3.json", {"--json", "--threads", "3"}).Json();
  for (nlohmann::json* json : {&one, &two}) {
    json->erase("seconds");
    json->erase("output");
    json->erase("pictures");
  }
  EXPECT_EQ(one, two);
}

// Mean albedo of a solve in the middle of the picture.
Eigen::Vector3d AlbedoOf(const std::string& capture, const std::string& rig,
                         const std::string& output) {
  const RunResult run = Solve({capture, "--rig", rig, "-o", output});
  EXPECT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, Not(HasSubstr("white_balance")));
  const Photo albedo = ReadPhoto(fs::path(output) / "albedo.exr").value();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (Eigen::Index c = 0; c < 3; ++c) {
    for (int y = 200; y < 280; ++y) {
      for (int x = 280; x < 360; ++x) {
        mean[c] += static_cast<double>(albedo.rgb[static_cast<size_t>(c)].At(x, y)) / 6400.0;
      }
    }
  }
  return mean;
}

TEST_F(CalibrateResponseCommand, AlbedoIsNeutralInWhicheverOrderTheRigIsCalibrated) {
  const std::string one_exposure = R"("exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100})";
  Render("sheet", "sheet", R"("albedo": [0.99, 0.99, 0.99])", one_exposure, Dimmer(kSensor));
  Render("fabric", "fabric", R"("albedo": [0.4, 0.4, 0.4])", one_exposure, Dimmer(kSensor));
  // By the ruler: no response, lights of one flux.
  nlohmann::json ruler = ReadJson(Path("true.json"));
  for (nlohmann::json& light : ruler["lights"]) {
    light["flux_rgb"] = {1, 1, 1};
  }
  WriteText(Path("ruler.json"), ruler.dump());
  const auto lights = [&](const std::string& rig, const std::string& output) {
    const RunResult run = sateen::testing::RunCommand<cli::CalibrateLightsArgs>(
        {"lights", "--sheet", Path("sheet"), "--rig", Path(rig), "--model", "near", "-o",
         Path(output), "--json"},
        cli::AddCalibrateLights, cli::RunCalibrateLights);
    ASSERT_EQ(run.exit_status, 0) << run.log;
    const nlohmann::json fitted = run.Json().at("lights");
    ASSERT_EQ(fitted.size(), 3U);
    for (const nlohmann::json& light : fitted) {
      // Truth is in the units of the files; the fit in those of its rig.
      EXPECT_LT(light.at("flux_error"), 3.0 * light.at("flux_sd")[1].get<double>()) << output;
      EXPECT_LT(light.at("flux_sd")[1], 0.002) << output;
    }
  };
  const auto response = [&](const std::string& rig, const std::string& output) {
    const RunResult run = RunOn("chart", output, {"--rig", Path(rig)});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  };
  response("ruler.json", "response-first.json");
  lights("response-first.json", "response-lights.json");
  lights("ruler.json", "lights-first.json");
  response("lights-first.json", "lights-response.json");
  response("lights-response.json", "twice.json");

  const Eigen::Vector3d raw = AlbedoOf(Path("fabric"), Path("ruler.json"), Path("maps-ruler"));
  EXPECT_LT(raw[0] / raw[1], 0.6);  // as the sensor sees it
  for (const char* rig :
       {"response-lights.json", "lights-first.json", "lights-response.json", "twice.json"}) {
    const Eigen::Vector3d albedo = AlbedoOf(Path("fabric"), Path(rig), Path("maps"));
    fmt::print("{}: albedo {:.4f} {:.4f} {:.4f}\n", rig, albedo[0], albedo[1], albedo[2]);
    EXPECT_NEAR(albedo[0] / albedo[1], 1.0, 0.002) << rig;
    EXPECT_NEAR(albedo[2] / albedo[1], 1.0, 0.002) << rig;
    EXPECT_NEAR(albedo[1], 0.4, 0.004) << rig;
  }
  // Without white paper the chart gives colour, not brightness.
  const Eigen::Vector3d chart_only =
      AlbedoOf(Path("fabric"), Path("response-first.json"), Path("maps"));
  EXPECT_NEAR(chart_only[0] / chart_only[1], 1.0, 0.002);
  EXPECT_NEAR(chart_only[2] / chart_only[1], 1.0, 0.002);
}

TEST_F(CalibrateResponseCommand, AChartThatLiesAskewAndTheOtherWayRoundIsFound) {
  // The patches' places turned by 183 degrees about a point off the middle: the chart in the picture
  // lies that way to this file.
  nlohmann::json chart = ReadJson(kChartFile);
  const double turn = 183.0 * 3.14159265358979 / 180.0;
  for (nlohmann::json& patch : chart["patches"]) {
    const double x = patch["center_mm"][0].get<double>() - 6.0;
    const double y = patch["center_mm"][1].get<double>() + 4.0;
    patch["center_mm"] = {std::cos(turn) * x - std::sin(turn) * y,
                          std::sin(turn) * x + std::cos(turn) * y};
  }
  WriteText(Path("askew.json"), chart.dump());

  const RunResult run = CalibrateResponse(
      {Path("chart"), "--patches", Path("askew.json"), "-o", Path("askew-rig.json"), "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  const nlohmann::json json = run.Json();
  EXPECT_NEAR(std::abs(json.at("chart").at("turned_deg").get<double>()), 177.0, 1.0);
  EXPECT_NEAR(json.at("chart").at("at_mm")[0], 6.0, 1.5);
  EXPECT_NEAR(json.at("chart").at("at_mm")[1], -4.0, 1.5);
  EXPECT_LT(json.at("error").at("white_balance"), 0.002);
}

TEST_F(CalibrateResponseCommand, FramesUnderWrongNamesAreFound) {
  const std::string swapped = Spoilt("swapped", [](nlohmann::json& session) {
    for (nlohmann::json& frame : session["frames"]) {
      if (frame["file"] == "frames/led-0-0.01s-1.dng") {
        frame["file"] = "frames/led-0-0.02s-1.dng";
        frame.erase("sha256");
      } else if (frame["file"] == "frames/led-0-0.02s-1.dng") {
        frame["file"] = "frames/led-0-0.01s-1.dng";
        frame.erase("sha256");
      }
    }
  });
  const RunResult run = RunOn(swapped, "bad.json");
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("times as bright as its"));
  EXPECT_THAT(run.log, HasSubstr("s are; are frames swapped"));
  EXPECT_FALSE(fs::exists(Path("bad.json")));
}

TEST_F(CalibrateResponseCommand, BadSessionsAreNamedWithTheirFault) {
  const auto keep = [](const auto& wanted) {
    return [wanted](nlohmann::json& session) {
      nlohmann::json kept = nlohmann::json::array();
      for (const nlohmann::json& frame : session["frames"]) {
        if (wanted(frame)) {
          kept.push_back(frame);
        }
      }
      session["frames"] = kept;
    };
  };
  ExpectError(Spoilt("one-exposure", keep([](const nlohmann::json& frame) {
                       return frame["exposure_s"] == 0.02 || frame["role"] == "dark";
                     })),
              "no light has frames of more than 1 exposure time; linearity needs at least 3");
  ExpectError(
      Spoilt("no-dark", keep([](const nlohmann::json& frame) { return frame["role"] == "lit"; })),
      "no dark frame; need at least a pair");
  ExpectError(Spoilt("bright", keep([](const nlohmann::json& frame) {
                       return frame["role"] == "dark" || frame["exposure_s"] == 0.13;
                     })),
              "add shorter exposures");
  ExpectError(Spoilt("sheet-kind", [](nlohmann::json& session) { session["kind"] = "sheet"; }),
              "is a session of kind 'sheet'; need a chart");
  ExpectError(Spoilt("developed",
                     [](nlohmann::json& session) {
                       session["frames"][1]["file"] = "overview.png";
                       session["frames"][1].erase("sha256");
                     }),
              "overview.png: is no camera RAW file");
  ExpectError(Spoilt("iso", [](nlohmann::json& session) { session["frames"][2]["iso"] = 200; }),
              "has another f_number or iso than frames/led-0-0.00125s-1.dng");
  Render("white", "chart", R"("albedo": [0.9, 0.9, 0.9])", kSeries, kSensor);
  ExpectError("white", "the chart was not found");
  Render("dead", "chart", kPatches, kSeries, kSensor, R"(, "illumination": {"dead": "led-6"})");
  ExpectError("dead", "the chart is dark under light 'led-6'");
}

TEST_F(CalibrateResponseCommand, WithoutPairsNoiseIsLeftOutWithAWarning) {
  const std::string single = Spoilt("single", [](nlohmann::json& session) {
    nlohmann::json kept = nlohmann::json::array();
    for (const nlohmann::json& frame : session["frames"]) {
      if (frame["file"].get<std::string>().ends_with("s-1.dng")) {
        kept.push_back(frame);
      }
    }
    session["frames"] = kept;
  });
  const RunResult run = RunOn(single, "single.json", {"--json"});
  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("gain and read noise are left out"));
  EXPECT_TRUE(run.Json().at("noise").is_null());
  EXPECT_FALSE(ReadRig(Path("single.json")).value().response->gain_dn_per_electron);
  EXPECT_FALSE(fs::exists(Path("single-response/photon-transfer.svg")));
}

TEST_F(CalibrateResponseCommand, TheSeriesOfAChartIsNoCaptureToSolve) {
  const RunResult run = Solve({Path("chart"), "-o", Path("maps-chart")});
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("need one frame for each light; the series of a chart is for"));
}

TEST_F(CalibrateResponseCommand, OptionsAreChecked) {
  EXPECT_EQ(CalibrateResponse({Path("chart"), "-o", Path("x.json")}).exit_status, 2);
  EXPECT_EQ(RunOn("chart", "x.json", {"--tolerance", "0"}).exit_status, 2);
  EXPECT_EQ(RunOn("chart", "x.json", {"--max-shift", "-1"}).exit_status, 2);
  EXPECT_EQ(RunOn("gone", "x.json").exit_status, 4);
  EXPECT_FALSE(fs::exists(Path("x.json")));
}

}  // namespace
}  // namespace sateen
