#include "scanner/sessions/sheet_reader.h"

#include <gmock/gmock.h>

#include "simulation/rigs.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::sheet_reader_test {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr ImageSize kPx = {64, 48};
constexpr BlockGrid kGrid = {.columns = 4, .rows = 3};

// White paper under two lights; of the first one two exposures, 0.1 s and 0.4 s.
class BracketedSheet : public ::testing::Test {
 protected:
  BracketedSheet() {
    std::filesystem::create_directories(dir_ / "frames");
    Rig rig = RingRig(kPx);
    rig.lights.resize(2);
    testing::WriteText(dir_ / "rig.json", RigToJson(rig));
    session_.kind = SessionKind::kSheet;
    session_.rig = "rig.json";
    Add("led-0", "short.png", 0.1);
    Add("led-0", "long.png", 0.4);
    Add("led-1", "other.png", 0.1);
    WriteFrame("short.png", 0.30, 0.10);
    WriteFrame("long.png", 1.0, 0.41);
    WriteFrame("other.png", 0.2, 0.2);
  }
  void Add(const std::string& light, const std::string& file, double exposure_s) {
    session_.frames.push_back({.light = light, .file = "frames/" + file, .exposure_s = exposure_s});
  }
  // With a little texture, so that it has noise.
  void WriteFrame(const std::string& file, double left, double right) {
    Image<uint16_t> plane(kPx);
    for (int y = 0; y < kPx.height; ++y) {
      for (int x = 0; x < kPx.width; ++x) {
        const double value = x < kPx.width / 2 ? left : right;
        plane.At(x, y) = static_cast<uint16_t>(65535.0 * value - (value < 1.0 ? (x + y) % 2 : 0));
      }
    }
    ASSERT_TRUE(WritePng16(dir_ / "frames" / file, {plane, plane, plane}));
  }
  Result<Sheet> Read() {
    testing::WriteText(dir_ / "session.json", SessionToJson(session_));
    return ReadSheet(dir_, {.grid = kGrid});
  }
  testing::TempFolder temp_;
  std::filesystem::path dir_ = temp_.Path() / "white";
  Session session_;
};

TEST_F(BracketedSheet, TakesEachBlockFromTheLongestExposureThatIsNotSaturated) {
  const Sheet sheet = Read().value();
  ASSERT_THAT(sheet.samples[0], SizeIs(12));
  for (size_t i = 0; i < 12; ++i) {
    const bool is_left = sheet.blocks[0][i] % kGrid.columns < 2;
    EXPECT_NEAR(sheet.samples[0][i].radiance_rgb[1], is_left ? 0.30 / 0.1 : 0.41 / 0.4, 3e-4)
        << i;  // 16 bits
    EXPECT_NEAR(sheet.samples[1][i].radiance_rgb[1], 0.2 / 0.1, 3e-4) << i;
  }
  EXPECT_TRUE(sheet.sha256_of_input.contains((dir_ / "frames/long.png").string()));
}

TEST_F(BracketedSheet, SaysWhatTheShortestExposureSaturates) {
  WriteFrame("short.png", 1.0, 1.0);
  WriteFrame("long.png", 1.0, 1.0);
  const Result<Sheet> sheet = Read();
  ASSERT_FALSE(sheet);
  EXPECT_THAT(sheet.error().message,
              HasSubstr("short.png: 100 % of the sheet under light 'led-0'"));
}

// A frame of paper may say that it has moved: nothing comes of it.
TEST_F(BracketedSheet, LeavesShiftsAside) {
  const Sheet before = Read().value();
  session_.frames[2].shift_px = Eigen::Vector2d(0.4, 0.2);
  const Sheet after = Read().value();
  EXPECT_EQ(before.samples[1][5].radiance_rgb, after.samples[1][5].radiance_rgb);
}

}  // namespace
}  // namespace sateen::sheet_reader_test
