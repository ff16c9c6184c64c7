#include "scanner/sessions/frames/sensor_reading.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "imaging/dng.h"
#include "scanner/sessions/block_means.h"
#include "scanner/sessions/dataset.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::sensor_reading_test {
namespace {

using ::testing::HasSubstr;

constexpr double kBlack = 500.0;
constexpr double kWhite = 4500.0;
const Response kNominal{.black = kBlack, .white = kWhite};

// One light's session of a RAW frame that reads `dn` of each colour all over, RGGB.
class SensorReadingTest : public ::testing::Test {
 protected:
  void Write(const std::array<double, 3>& dn, const std::optional<Response>& response) {
    Image<uint16_t> mosaic(64, 64);
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        const size_t colour = x % 2 != y % 2 ? 1 : x % 2 == 0 ? 0 : 2;
        mosaic.At(x, y) = static_cast<uint16_t>(dn[colour]);
      }
    }
    std::filesystem::create_directories(temp_.Path());
    ASSERT_TRUE(WriteDng(temp_.Path() / "east.dng", mosaic, {.black = kBlack, .white = kWhite}));
    Rig rig = testing::FourLights();
    rig.lights.resize(1);
    rig.response = response;
    testing::WriteText(temp_.Path() / "rig.json", RigToJson(rig));
    Session session;
    session.rig = "rig.json";
    session.frames = {{.role = FrameRole::kLit, .light = "east", .file = "east.dng"}};
    testing::WriteText(temp_.Path() / "session.json", SessionToJson(session));
  }

  [[nodiscard]] LightFrame Read() const { return testing::MustRead(temp_.Path()).stack[0]; }
  [[nodiscard]] BlockMean ReadBlock(const std::optional<Response>& response) const {
    return ReadBlockMeans({.path = temp_.Path() / "east.dng", .response = response},
                          {.columns = 1, .rows = 1})
        ->blocks[0];
  }

  testing::TempFolder temp_;
};

Response Measured() {
  Response response{.black = 510.0, .white = 4000.0};
  response.white_balance = {2.0, 1.0, 1.5};
  return response;
}

TEST_F(SensorReadingTest, WithoutAResponseOrWithTheNominalOneValuesAreTheFiles) {
  for (const std::optional<Response>& response : {std::optional<Response>(), {kNominal}}) {
    Write({1500.0, 2500.0, 3500.0}, response);
    const LightFrame frame = Read();
    EXPECT_EQ(frame.full_scale, 1.0F);
    EXPECT_EQ(frame.rgb[0].At(20, 20), 0.25F);
    EXPECT_EQ(frame.rgb[1].At(21, 20), 0.5F);
    EXPECT_EQ(frame.rgb[2].At(21, 21), 0.75F);
    EXPECT_FALSE(ReadBlock(response).saturated);
  }
}

TEST_F(SensorReadingTest, BlackAndBalanceApplyToFramesAndBlocksAlike) {
  Write({1510.0, 2510.0, 3510.0}, Measured());
  const LightFrame frame = Read();
  const BlockMean block = ReadBlock(Measured());
  // Above the measured black, in the file's own unit, times the balance.
  const std::array<float, 3> expected = {2.0F * 0.25F, 0.5F, 1.5F * 0.75F};
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(frame.rgb[c].At(20, 20), expected[c], 1e-6F);
    EXPECT_NEAR(block.radiance_rgb[static_cast<Eigen::Index>(c)], static_cast<double>(expected[c]),
                1e-6);
  }
  EXPECT_FALSE(block.saturated);
  // Where the last channel saturates: red, which counts twice.
  EXPECT_NEAR(frame.full_scale, 2.0F * (4000.0F - 510.0F) / 4000.0F, 1e-6F);
}

TEST_F(SensorReadingTest, ASiteFromTheMeasuredWhiteOnIsSaturatedInItsOwnColour) {
  Write({600.0, 4000.0, 600.0}, Measured());
  const LightFrame frame = Read();
  EXPECT_GE(frame.rgb[1].At(21, 20), frame.full_scale);
  EXPECT_LT(frame.rgb[0].At(20, 20), 0.1F);
  EXPECT_TRUE(ReadBlock(Measured()).saturated);
  Write({600.0, 3999.0, 600.0}, Measured());
  EXPECT_LT(Read().rgb[1].At(21, 20), Read().full_scale);
}

TEST_F(SensorReadingTest, AResponseOfAnotherCameraIsRefused) {
  Response other = kNominal;
  other.black = 100.0;
  other.white = 490.0;
  Write({1500.0, 2500.0, 3500.0}, other);
  const Error error = testing::FailureOf(temp_.Path());
  EXPECT_THAT(error.message, HasSubstr("the response is of another camera or mode"));
  other.white = 60000.0;  // a mode with more bits: the file's own white holds
  Write({1500.0, 2500.0, 4500.0}, other);
  EXPECT_GE(Read().rgb[2].At(21, 21), Read().full_scale);
}

TEST_F(SensorReadingTest, OtherFilesGetTheBalanceAlone) {
  Rig rig = testing::FourLights();
  rig.response = Measured();
  const Session session = testing::FourLightSession();
  testing::WriteSession(temp_.Path() / "s", session);
  testing::WriteText(temp_.Path() / "rig.json", RigToJson(rig));

  const Dataset dataset = testing::MustRead(temp_.Path() / "s");

  // 0.1 less the dark frame's 0.05.
  EXPECT_NEAR(dataset.stack[0].rgb[0].At(1, 1), 2.0F * 0.05F, 1e-6F);
  EXPECT_NEAR(dataset.stack[0].rgb[1].At(1, 1), 0.05F, 1e-6F);
  EXPECT_NEAR(dataset.stack[0].rgb[2].At(1, 1), 1.5F * 0.05F, 1e-6F);
  EXPECT_TRUE(std::isinf(dataset.stack[0].full_scale));
}

}  // namespace
}  // namespace sateen::sensor_reading_test
