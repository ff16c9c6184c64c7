#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "cli/calibrate/calibrate_lights.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "tests/cli/simulated_chart.h"

namespace sateen::calibrate_response_test {
namespace {

using namespace sateen::testing;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::Not;

namespace fs = std::filesystem;

// Close together where patches come near saturation, so that one of every colour lies between where
// the sensor bends by 1 % and there.
constexpr const char* kSeries = R"("exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100,
    "series_s": [0.00125, 0.005, 0.01, 0.02, 0.025, 0.032, 0.0438, 0.054, 0.065, 0.0755, 0.0825,
    0.13], "series_light": "led-0", "repeats": 2})";

// The same exposed so that white paper stays where it is linear.
std::string Dimmer(std::string sensor) {
  const std::string full_scale = R"("full_scale": 1.2)";
  return sensor.replace(sensor.find(full_scale), full_scale.size(), R"("full_scale": 2)");
}

class CalibrateResponseCommand : public SimulatedChart {
 protected:
  static void SetUpTestSuite() {
    MakeRig();
    Render("chart", "chart", kPatches, kSeries, kSensor);
  }
};

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
  // 0.03 d^2 = 0.01 x, d = (x - 0.75) / 0.25, at x = 0.8841, which reads as 0.8753; 0.002 x at
  // 0.8082.
  const double departs_dn = 600.0 + 15292.0 * 0.8753;
  const double fine_dn = 600.0 + 15292.0 * 0.8066;
  for (const char* colour : {"red", "green", "blue"}) {
    const nlohmann::json& channel = json.at("linearity").at(colour);
    fmt::print(
        "{}: linear within 1 % from {:.0f} to {:.0f} DN (true: {:.0f}), within 0.2 % to {:.0f} "
        "(true: {:.0f}), saturated from {}\n",
        colour, channel.at("from_dn").get<double>(), channel.at("to_dn").get<double>(), departs_dn,
        channel.at("fine_to_dn").get<double>(), fine_dn, channel.at("saturation_dn").dump());
    EXPECT_TRUE(channel.at("departs"));
    // A patch lies within 2 % beyond; straight lines between patches end too low, if at all.
    EXPECT_NEAR(channel.at("to_dn"), departs_dn, 0.005 * departs_dn);
    EXPECT_LT(channel.at("fine_to_dn"), 1.01 * fine_dn);  // 0.05 % of noise a patch
    EXPECT_GT(channel.at("fine_to_dn"), 0.93 * fine_dn);  // patches lie 8 % apart there
    EXPECT_LT(channel.at("from_dn"), 660.0);
    EXPECT_EQ(channel.at("saturation_dn"), 15100.0);
  }
  EXPECT_NEAR(json.at("white_dn"), departs_dn, 0.005 * departs_dn);
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
  const ResponseRecord record = rig.calibration.response.value();
  EXPECT_THAT(record.inputs.value(), Contains(Key(HasSubstr("chart/frames/led-3-0.02s-1.dng"))));
  EXPECT_THAT(record.inputs.value(), Contains(Key(HasSubstr("neutral.json"))));
  EXPECT_EQ(record.noise.value().value().read_noise_dn,
            json.at("noise").at("read_noise_dn").get<double>());
  EXPECT_FALSE(record.linearity.value().red.value().bins);  // a picture's worth
  EXPECT_FALSE(json.at("linearity").at("red").at("bins").empty());
  EXPECT_EQ(json.at("former_rig"), "");
  // Text, over the rig just written: that one is kept.
  const RunResult again = RunOn("chart", "kept.json");
  EXPECT_THAT(again.out, HasSubstr("the previous file is kept as"));
  EXPECT_THAT(again.out,
              HasSubstr("expose white paper to half or two thirds of white, at most to"));
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
    const RunResult run = RunCommand<cli::CalibrateLightsArgs>(
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
  // The patches' places turned by 183 degrees about a point off the middle: the chart in the
  // picture lies that way to this file.
  nlohmann::json chart = ReadJson(ChartFile());
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

}  // namespace
}  // namespace sateen::calibrate_response_test
