#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "rig/rig.h"
#include "tests/cli/simulated_chart.h"

namespace sateen::calibrate_response_errors_test {
namespace {

using namespace sateen::testing;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

// Few, as no figure is asked of them.
constexpr const char* kSeries = R"("exposure": {"exposure_s": 0.02, "f_number": 8, "iso": 100,
    "series_s": [0.00125, 0.005, 0.01, 0.02, 0.05, 0.13], "series_light": "led-0", "repeats": 2})";

class CalibrateResponseErrors : public SimulatedChart {
 protected:
  static void SetUpTestSuite() {
    MakeRig();
    Render("chart", "chart", kPatches, kSeries, kSensor);
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
};

TEST_F(CalibrateResponseErrors, FramesUnderWrongNamesAreFound) {
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

TEST_F(CalibrateResponseErrors, BadSessionsAreNamedWithTheirFault) {
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
              "overview.png: is not a camera RAW file");
  ExpectError(Spoilt("iso", [](nlohmann::json& session) { session["frames"][2]["iso"] = 200; }),
              "has another f_number or iso than frames/led-0-0.00125s-1.dng");
  Render("white", "chart", R"("albedo": [0.9, 0.9, 0.9])", kSeries, kSensor);
  ExpectError("white", "the chart was not found");
  Render("dead", "chart", kPatches, kSeries, kSensor, R"(, "illumination": {"dead": "led-6"})");
  ExpectError("dead", "the chart is dark under light 'led-6'");
}

TEST_F(CalibrateResponseErrors, WithoutPairsNoiseIsLeftOutWithAWarning) {
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

TEST_F(CalibrateResponseErrors, TheSeriesOfAChartIsNoCaptureToSolve) {
  const RunResult run = Solve({Path("chart"), "-o", Path("maps-chart")});
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("need one frame for each light; the series of a chart is for"));
}

TEST_F(CalibrateResponseErrors, OptionsAreChecked) {
  EXPECT_EQ(CalibrateResponse({Path("chart"), "-o", Path("x.json")}).exit_status, 2);
  EXPECT_EQ(RunOn("chart", "x.json", {"--tolerance", "0"}).exit_status, 2);
  EXPECT_EQ(RunOn("chart", "x.json", {"--max-shift", "-1"}).exit_status, 2);
  EXPECT_EQ(RunOn("gone", "x.json").exit_status, 4);
  EXPECT_FALSE(fs::exists(Path("x.json")));
}

}  // namespace
}  // namespace sateen::calibrate_response_errors_test
