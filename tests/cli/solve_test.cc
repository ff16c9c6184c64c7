#include "cli/solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "imaging/image_io.h"
#include "tests/cli/cli_runner.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"

namespace sateen::solve_test {
namespace {

using sateen::testing::DataDir;
using sateen::testing::RunResult;
using sateen::testing::Simulate;
using sateen::testing::Solve;
using sateen::testing::TempFolder;
using sateen::testing::WriteText;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

namespace fs = std::filesystem;

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
constexpr const char* kScene = R"({
  "schema": "sateen.scene/1", "rig": "rig.json",
  "surface": {"shape": "sphere", "radius_mm": 240, "edge_deg": 30},
  "materials": {"surface": {"texture": {"kind": "waves", "min": 0.2, "max": 0.8, "period_mm": 100}}}
})";

class SolveCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteText(Path("rig.json"), kRig);
    WriteText(Path("scene.json"), kScene);
    const RunResult run = Simulate({Path("scene.json"), "-o", Path("session"), "--linear"});
    ASSERT_EQ(run.exit_status, 0) << run.log;
  }

  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_.Path() / name).string();
  }

 private:
  TempFolder folder_;
};

TEST_F(SolveCommand, PrintsTheFixedNamesAsJson) {
  const RunResult run = Solve({Path("session"), "-o", Path("maps"), "--json", "--threads", "1"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, IsEmpty());
  const nlohmann::json json = run.Json();
  EXPECT_EQ(json.at("schema"), "sateen.solve/1");
  EXPECT_EQ(json.at("pixels"), 48 * 32);
  EXPECT_EQ(json.at("solved"), 48 * 32);
  EXPECT_EQ(json.at("threads"), 1);
  EXPECT_EQ(json.at("backend"), "auto");
  EXPECT_GT(json.at("seconds"), 0.0);
  for (const char* figure : {"mean", "median", "p99", "max"}) {
    // Noiseless: the bar for the maximum.
    EXPECT_LT(json.at("angular_error_deg").at(figure), 1e-3) << figure;
  }
  EXPECT_LT(json.at("albedo_error").at("max"), 1e-5);
}

TEST_F(SolveCommand, WritesTheMapsAndTheirRecord) {
  ASSERT_EQ(Solve({Path("session"), "-o", Path("maps")}).exit_status, 0);

  for (const char* name :
       {"normal.exr", "normal.png", "albedo.exr", "residual.exr", "samples.png", "reason.png",
        "uncertainty.exr", "model.png", "error.exr", "overview.png", "solve.json"}) {
    EXPECT_TRUE(fs::exists(Path(std::string("maps/") + name))) << name;
  }
  const Image3 normal = ReadImage3(Path("maps/normal.exr")).value();
  const Image3 truth = ReadImage3(Path("session/truth/normal.exr")).value();
  EXPECT_NEAR(normal[1].At(24, 4), truth[1].At(24, 4), 1e-5);
  EXPECT_GT(truth[1].At(24, 4), 0.1F);  // above the centre of a dome: y up
}

TEST_F(SolveCommand, NormalYDownFlipsTheSecondChannelAlone) {
  ASSERT_EQ(Solve({Path("session"), "-o", Path("up")}).exit_status, 0);
  ASSERT_EQ(Solve({Path("session"), "-o", Path("down"), "--normal-y", "down"}).exit_status, 0);

  const Image3 up = ReadImage3(Path("up/normal.exr")).value();
  const Image3 down = ReadImage3(Path("down/normal.exr")).value();
  for (size_t p = 0; p < up[0].pixels.size(); ++p) {
    EXPECT_EQ(up[0].pixels[p], down[0].pixels[p]);
    EXPECT_EQ(up[1].pixels[p], -down[1].pixels[p]);
    EXPECT_EQ(up[2].pixels[p], down[2].pixels[p]);
  }
  const Image3 png = ReadPhoto(Path("down/normal.png"), Encoding::kLinear).value().rgb;
  EXPECT_LT(png[1].At(24, 4), 0.5F);
}

TEST_F(SolveCommand, UsesOnlyTheLightsAsked) {
  const RunResult run = Solve({Path("session"), "-o", Path("maps"), "--lights", "0,1,3", "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_EQ(run.Json().at("lights"), 3);
}

TEST_F(SolveCommand, TakesAnotherRig) {
  std::string dimmer = kRig;
  for (size_t at = dimmer.find("0.4, 0.4, 0.4"); at != std::string::npos;
       at = dimmer.find("0.4, 0.4, 0.4")) {
    dimmer.replace(at, 13, "0.8, 0.8, 0.8");
  }
  WriteText(Path("other.json"), dimmer);

  const RunResult run =
      Solve({Path("session"), "-o", Path("maps"), "--rig", Path("other.json"), "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  // Twice the light is said to have come, so the albedo halves.
  EXPECT_NEAR(run.Json().at("albedo_error").at("mean"), 0.5, 1e-5);
}

TEST_F(SolveCommand, WrongOptionsAreUsageErrors) {
  EXPECT_EQ(Solve({Path("session")}).exit_status, 2);
  EXPECT_EQ(Solve({Path("session"), "-o", Path("m"), "--backend", "svd"}).exit_status, 2);
  EXPECT_EQ(Solve({Path("session"), "-o", Path("m"), "--robust", "l1"}).exit_status, 2);
  const RunResult run = Solve({Path("session"), "-o", Path("m"), "--clip-level", "2"});
  EXPECT_EQ(run.exit_status, 2);
  EXPECT_THAT(run.log, HasSubstr("clip_level = 2; need"));
  EXPECT_EQ(Solve({Path("session"), "-o", Path("m"), "--lights", "0,1,9"}).exit_status, 2);
  EXPECT_FALSE(fs::exists(Path("m")));
}

TEST_F(SolveCommand, AFrameThatIsCutShortIsNamedAndNothingIsWritten) {
  const std::string frame = Path("session/frames/west.exr");
  fs::resize_file(frame, fs::file_size(frame) / 2);

  const RunResult run = Solve({Path("session"), "-o", Path("maps")});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, AllOf(HasSubstr("sateen solve: error: "), HasSubstr("west.exr")));
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_FALSE(fs::exists(Path("maps")));
}

TEST_F(SolveCommand, AMissingCaptureIsAnIoError) {
  const RunResult run = Solve({Path("nowhere"), "-o", Path("maps")});

  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr("nowhere"));
}

TEST_F(SolveCommand, AnEmptyFolderIsBadData) {
  fs::create_directory(Path("empty"));

  const RunResult run = Solve({Path("empty"), "-o", Path("maps")});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("session.json"));
}

TEST_F(SolveCommand, AnOutputThatIsAFileIsAnIoError) {
  WriteText(Path("taken"), "mine");

  const RunResult run = Solve({Path("session"), "-o", Path("taken")});

  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr("taken"));
}

TEST_F(SolveCommand, TheCaptureItselfIsNoPlaceForMaps) {
  const RunResult run = Solve({Path("session"), "-o", Path("session")});

  EXPECT_EQ(run.exit_status, 2);
  EXPECT_THAT(run.log, HasSubstr("is the capture itself"));
  EXPECT_FALSE(fs::exists(Path("session/normal.exr")));
}

TEST_F(SolveCommand, ATiltedSheetIsRefused) {
  std::ifstream file(Path("session/session.json"));
  nlohmann::json session = nlohmann::json::parse(file);
  session["table_from_sheet"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1};
  WriteText(Path("session/session.json"), session.dump());

  const RunResult run = Solve({Path("session"), "-o", Path("maps")});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("table_from_sheet"));
}

TEST_F(SolveCommand, TheErrorMapOfAnEarlierSolveDoesNotStay) {
  ASSERT_EQ(Solve({Path("session"), "-o", Path("maps")}).exit_status, 0);
  ASSERT_TRUE(fs::exists(Path("maps/error.exr")));
  fs::remove_all(Path("session/truth"));

  ASSERT_EQ(Solve({Path("session"), "-o", Path("maps")}).exit_status, 0);

  EXPECT_FALSE(fs::exists(Path("maps/error.exr")));
  EXPECT_TRUE(fs::exists(Path("maps/normal.exr")));
}

TEST_F(SolveCommand, AMeanErrorWithinTheLimitPasses) {
  const RunResult run =
      Solve({Path("session"), "-o", Path("maps"), "--fail-above", "0.001", "--json"});

  EXPECT_EQ(run.exit_status, 0);  // noiseless: PrintsTheFixedNamesAsJson
  EXPECT_THAT(run.log, IsEmpty());
  EXPECT_EQ(run.Json().at("fail_above_deg"), 0.001);
  EXPECT_EQ(run.Json().at("passed"), true);

  const RunResult unasked = Solve({Path("session"), "-o", Path("maps"), "--json"});
  EXPECT_FALSE(unasked.Json().contains("fail_above_deg"));
  EXPECT_FALSE(unasked.Json().contains("passed"));
}

TEST_F(SolveCommand, AMeanErrorAboveTheLimitFailsAfterWritingAll) {
  // The lights of east and north as each other's: normals come out mirrored.
  std::string swapped = kRig;
  swapped.replace(swapped.find("[0.6, 0, 0.8]"), 13, "[0, 0.6, 0.8]");
  swapped.replace(swapped.rfind("[0, 0.6, 0.8]"), 13, "[0.6, 0, 0.8]");
  WriteText(Path("swapped.json"), swapped);

  const RunResult run = Solve({Path("session"), "-o", Path("maps"), "--rig", Path("swapped.json"),
                               "--fail-above", "0.05", "--json"});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_EQ(run.log, fmt::format("sateen solve: mean angular error {:.4g} deg is above "
                                 "--fail-above 0.05\n",
                                 run.Json().at("angular_error_deg").at("mean").get<double>()));
  EXPECT_EQ(run.Json().at("passed"), false);
  EXPECT_TRUE(fs::exists(Path("maps/error.exr")));
  std::ifstream record(Path("maps/solve.json"));
  EXPECT_EQ(nlohmann::json::parse(record), run.Json());
}

TEST_F(SolveCommand, ALimitWithNothingToCompareFails) {
  Image3 unknown = ReadImage3(Path("session/truth/normal.exr")).value();
  unknown = Image3(unknown.Size());  // zero: not known
  ASSERT_TRUE(WriteExr(Path("session/truth/normal.exr"), unknown));

  const RunResult run = Solve({Path("session"), "-o", Path("maps"), "--fail-above", "5", "--json"});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("no solved pixel has truth"));
  EXPECT_EQ(run.Json().at("passed"), false);
}

TEST_F(SolveCommand, ALimitWithoutTruthIsRefusedBeforeTheSolve) {
  fs::remove_all(Path("session/truth"));

  const RunResult run = Solve({Path("session"), "-o", Path("maps"), "--fail-above", "5"});

  EXPECT_EQ(run.exit_status, 3);
  EXPECT_THAT(run.log, HasSubstr("the capture has no truth; --fail-above needs truth/normal.exr, "
                                 "normal_gt.exr or Normal_gt.mat"));
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_FALSE(fs::exists(Path("maps")));
}

TEST_F(SolveCommand, ALimitThatIsNoAngleIsAUsageError) {
  for (const char* angle : {"0", "-1", "180.5", "inf", "nan", "1deg", "x", ""}) {
    const RunResult run = Solve({Path("session"), "-o", Path("m"), "--fail-above", angle});
    EXPECT_EQ(run.exit_status, 2) << angle;
    EXPECT_THAT(run.log, HasSubstr("--fail-above")) << angle;
  }
  EXPECT_FALSE(fs::exists(Path("m")));
}

TEST_F(SolveCommand, CancellingLeavesNothing) {
  const std::atomic<bool> cancel = true;

  const RunResult run = Solve({Path("session"), "-o", Path("maps")}, {.cancel = &cancel});

  EXPECT_EQ(run.exit_status, 6);
  EXPECT_FALSE(fs::exists(Path("maps")));
}

TEST_F(SolveCommand, AFullDiskLeavesTheFormerMapsWhole) {
  ASSERT_EQ(Solve({Path("session"), "-o", Path("maps")}).exit_status, 0);
  const Image3 before = ReadImage3(Path("maps/normal.exr")).value();
  const auto files = std::distance(fs::directory_iterator(Path("maps")), {});

  RunResult run;
  {
    const testing::FullDisk full(4000);
    run = Solve({Path("session"), "-o", Path("maps"), "--normal-y", "down"});
  }

  EXPECT_EQ(run.exit_status, 4);
  EXPECT_THAT(run.log, HasSubstr(".exr"));
  EXPECT_EQ(ReadImage3(Path("maps/normal.exr")).value()[1].pixels, before[1].pixels);
  EXPECT_EQ(std::distance(fs::directory_iterator(Path("maps")), {}), files);
}

// ---- Real photographs ---------------------------------------------------------------------------

class RealData : public ::testing::Test {
 protected:
  // The mean angular error of a solve, or a failure.
  double MeanErrorDeg(const fs::path& capture, std::vector<std::string> more = {}) {
    std::vector<std::string> words = {(DataDir() / capture).string(), "-o",
                                      (folder_.Path() / "maps").string(), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const RunResult run = Solve(words);
    EXPECT_EQ(run.exit_status, 0) << run.log;
    return run.exit_status == 0 ? run.Json().at("angular_error_deg").at("mean").get<double>()
                                : -1.0;
  }

  TempFolder folder_;
};

TEST_F(RealData, DiligentBallIsSolvedAsPublished) {
  SATEEN_NEEDS_DATA("diligent-ball");

  // Published for plain least squares: 4.10; the bar is 4.3. Better than 3 would be another method.
  const double mean_deg = MeanErrorDeg("diligent-ball", {"--robust", "none"});
  EXPECT_GT(mean_deg, 3.0);
  EXPECT_LT(mean_deg, 4.3);
  EXPECT_NEAR(MeanErrorDeg("diligent-ball", {"--robust", "none", "--backend", "jacobi-svd"}),
              mean_deg, 1e-4);
}

TEST_F(RealData, DiligentBallByTheLadder) {
  SATEEN_NEEDS_DATA("diligent-ball");

  // Sparse Bayesian regression: 2.55 on the ten. Published with 96: bi-polynomial 1.74.
  EXPECT_LE(MeanErrorDeg("diligent-ball"), 1.8);
  EXPECT_LE(MeanErrorDeg("diligent-ball", {"--lights", "0,10,20,30,40,50,60,70,80,90"}), 2.45);
}

TEST_F(RealData, BunnyOfEveryRenderingIsSolvedAsByOthers) {
  SATEEN_NEEDS_DATA("bunny");

  // Least squares of all samples, shadows included: 4.16 (lambert) and 18.47 (specular). Here
  // samples of zero are always left out, which moves the specular one by less than half a degree.
  EXPECT_NEAR(MeanErrorDeg("bunny/specular", {"--robust", "none", "--shadow-level", "0"}), 18.47,
              0.5);
  EXPECT_LT(MeanErrorDeg("bunny/lambert", {"--robust", "none"}), 4.2);
}

constexpr std::array kTenOfBunny = {2, 3, 4, 18, 20, 23, 24, 26, 34, 36};

TEST_F(RealData, ShinyBunnyByTheLadder) {
  SATEEN_NEEDS_DATA("bunny");

  // Sparse Bayesian regression: 6.2 on the ten, 4.0 on all fifty.
  EXPECT_LE(MeanErrorDeg("bunny/specular", {"--lights", "2,3,4,18,20,23,24,26,34,36"}), 5.8);
  EXPECT_LE(MeanErrorDeg("bunny/specular"), 4.0);
}

// The ten photographs as a camera has them whose exposure puts the 95th percentile of the masked
// samples at 0.8 of full scale.
void WriteExposedBunny(const fs::path& folder) {
  const fs::path bunny = DataDir() / "bunny";
  const Mask mask = ReadMask(bunny / "mask.png").value();
  std::vector<Image3> images;
  std::vector<float> samples;
  for (const int k : kTenOfBunny) {
    images.push_back(ReadImage3(bunny / fmt::format("specular/image{:03}.exr", k)).value());
    for (size_t p = 0; p < mask.pixels.size(); ++p) {
      if (mask.pixels[p] != 0) {
        samples.push_back(images.back()[1].pixels[p]);
      }
    }
  }
  const auto place = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() * 95 / 100);
  std::nth_element(samples.begin(), place, samples.end());
  std::ifstream all_lights(bunny / "lights.txt");
  std::vector<std::string> lines;
  for (std::string line; std::getline(all_lights, line);) {
    lines.push_back(line);
  }
  std::string lights;
  fs::create_directories(folder);
  for (size_t j = 0; j < images.size(); ++j) {
    const Image3& image = images[j];
    std::array<Image<uint16_t>, 3> picture;
    for (size_t c = 0; c < 3; ++c) {
      picture[c] = Image<uint16_t>(image.Size());
      for (size_t p = 0; p < mask.pixels.size(); ++p) {
        const float exposed = std::min(1.0F, 0.8F / *place * image[c].pixels[p]);
        picture[c].pixels[p] = static_cast<uint16_t>(std::lround(65535.0F * exposed));
      }
    }
    ASSERT_TRUE(WritePng16(folder / fmt::format("image{:03}.png", j), picture));
    lights += lines[static_cast<size_t>(kTenOfBunny.at(j))] + '\n';
  }
  WriteText(folder / "lights.txt", lights);
  fs::copy_file(bunny / "mask.png", folder / "mask.png");
  fs::copy_file(bunny / "normal_gt.exr", folder / "normal_gt.exr");
}

TEST_F(RealData, ClippedBunnyByTheLadder) {
  SATEEN_NEEDS_DATA("bunny");

  const fs::path folder = folder_.Path() / "exposed";
  WriteExposedBunny(folder);
  // Sparse Bayesian regression 5.90, least squares 8.06.
  EXPECT_LE(MeanErrorDeg(folder), 5.2);
}

TEST_F(RealData, EightBitPhotographsAreLinearisedWithAWarning) {
  SATEEN_NEEDS_DATA("uw-psm");

  const RunResult run = Solve(
      {(DataDir() / "uw-psm/cat").string(), "-o", (folder_.Path() / "maps").string(), "--json"});

  ASSERT_EQ(run.exit_status, 0) << run.log;
  EXPECT_THAT(run.log, HasSubstr("sRGB"));
  EXPECT_EQ(run.Json().at("lights"), 12);
  EXPECT_GT(run.Json().at("solved").get<double>(), 0.98 * run.Json().at("pixels").get<double>());
}

}  // namespace
}  // namespace sateen::solve_test
