#include "scanner/sessions/frames/mosaic_loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scanner/sessions/dataset.h"
#include "tests/imaging/dng.h"
#include "tests/scanner/sessions/dataset_files.h"
#include "tests/testing/full_disk.h"

namespace sateen::mosaic_loader_test {
namespace {

using ::testing::HasSubstr;
using testing::kDirections;

Response ResponseOf(double black) {
  Response response;
  response.black = black;
  response.white = 3900.0;
  response.white_balance = {2.0, 1.0, 1.5};
  response.gain_dn_per_electron = 0.25;
  response.read_noise_dn = 3.0;
  return response;
}

// Four equal DNG files under four lights, and two dark ones.
class MosaicLoader : public ::testing::Test {
 protected:
  MosaicLoader() {
    for (int k = 0; k < 6; ++k) {
      testing::WriteText(Path(k), testing::DngBytes({}));
      const FrameFile file{.path = Path(k), .exposure = 0.5, .response = ResponseOf(90.0)};
      if (k < 4) {
        plan_.lit.push_back({file});
      } else {
        plan_.dark.push_back(file);
        plan_.dark.back().exposure = 0.25 * (k - 3);
      }
    }
    plan_.rig.response = ResponseOf(90.0);
  }
  [[nodiscard]] std::filesystem::path Path(int k) const {
    return temp_.Path() / fmt::format("frame{}.dng", k);
  }
  [[nodiscard]] Result<LoadedMosaics> Load(const MosaicMemory& memory = {}) const {
    return LoadMosaics(plan_, noise_, temp_.Path(), {}, memory);
  }
  [[nodiscard]] std::string WhyNot() const { return WhyNoMosaics(plan_).value_or(""); }

  testing::TempFolder temp_;
  ReadPlan plan_;
  SensorNoise noise_{.gain_dn = 0.25, .read_dn = 3.0, .source = "the rig"};
};

std::vector<uint16_t> AllOf(const LoadedMosaics& mosaics, size_t frame) {
  std::vector<uint16_t> buffer;
  const auto rows = mosaics.stack.rows->Read(frame, 0, mosaics.stack.size_px.height, buffer);
  return {rows.begin(), rows.end()};
}

TEST_F(MosaicLoader, ReadingsAndTheirLevelsAreThoseOfTheFile) {
  const LoadedMosaics mosaics = Load().value();
  const testing::DngSpec spec;
  ASSERT_EQ(mosaics.stack.lit.size(), 4U);
  ASSERT_EQ(mosaics.stack.dark.size(), 2U);
  EXPECT_THAT(mosaics.stack.cfa, ::testing::ElementsAreArray(spec.cfa));
  const std::vector<uint16_t> readings = AllOf(mosaics, 3);
  const auto width = static_cast<size_t>(mosaics.stack.size_px.width);
  EXPECT_EQ(readings[10 * width + 20], testing::Reading(20, 10));
  // (20, 10) is red: w_r (v + shift) / H, v = (dn - 100) / 3900, shift = 10 / 3900, by hand.
  const MosaicFrame& frame = mosaics.stack.lit[1];
  const float radiance = frame.per_dn[0] * 1090.0F + frame.at_zero[0];
  EXPECT_NEAR(radiance, 2.0F * (1000.0F / 3900.0F) / 0.5F, 1e-5F);
  EXPECT_NEAR(frame.saturated_dn, 3900.0F, 0.01F);  // the response's white, below the file's
  EXPECT_EQ(frame.gain_dn, 0.25);
  EXPECT_NEAR(frame.read_dn, std::sqrt(9.0 + 1.0 / 12.0), 1e-9);
  EXPECT_FLOAT_EQ(mosaics.stack.dark_weights[0], 0.2F);  // by the squares of 0.25 and 0.5
  EXPECT_FLOAT_EQ(mosaics.stack.dark_weights[1], 0.8F);
  EXPECT_EQ(mosaics.sha256_of_input.size(), 6U);
}

TEST_F(MosaicLoader, AFileHoldsWhatMemoryShouldNot) {
  const LoadedMosaics in_memory = Load().value();
  const LoadedMosaics in_file = Load({.readings = 0, .decoded = 1}).value();
  for (size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(AllOf(in_file, k), AllOf(in_memory, k)) << k;
  }
  std::vector<uint16_t> buffer;
  const auto two_rows = in_file.stack.rows->Read(2, 7, 9, buffer);
  const std::vector<uint16_t> all = AllOf(in_memory, 2);
  const auto width = static_cast<size_t>(in_file.stack.size_px.width);
  ASSERT_EQ(two_rows.size(), 2 * width);
  EXPECT_TRUE(std::equal(two_rows.begin(), two_rows.end(),
                         all.begin() + static_cast<std::ptrdiff_t>(7 * width)));
  for (const auto& entry : std::filesystem::directory_iterator(temp_.Path())) {
    EXPECT_EQ(entry.path().extension(), ".dng") << entry.path();  // it has no name
  }
}

TEST_F(MosaicLoader, AScratchFileThatHasNoRoomSaysWhatItNeeds) {
  const testing::FullDisk limit(1000);
  const Result<LoadedMosaics> mosaics = Load({.readings = 0});
  ASSERT_FALSE(mosaics);
  EXPECT_EQ(mosaics.error().code, ErrorCode::kIo);
  EXPECT_THAT(mosaics.error().message, HasSubstr("scratch space"));
}

TEST_F(MosaicLoader, AFileThatChangedOrDoesNotFitIsNamed) {
  plan_.lit[2][0].sha256 = std::string(64, '0');
  const Result<LoadedMosaics> changed = Load();
  ASSERT_FALSE(changed);
  EXPECT_THAT(changed.error().message, HasSubstr(Path(2).string()));
  plan_.lit[2][0].sha256.reset();
  testing::DngSpec other;
  other.cfa.assign(testing::kBayerOrders[1].begin(), testing::kBayerOrders[1].end());
  testing::WriteText(Path(3), testing::DngBytes(other));
  const Result<LoadedMosaics> mixed = Load();
  ASSERT_FALSE(mixed);
  EXPECT_THAT(mixed.error().message, HasSubstr(Path(3).string()));
  EXPECT_THAT(mixed.error().message, HasSubstr("another order"));
}

TEST_F(MosaicLoader, SaysWhyACaptureHasNoMosaics) {
  EXPECT_EQ(WhyNot(), "");
  plan_.lit[1][0].shift_px = {0.0, 0.4};
  EXPECT_THAT(WhyNot(), HasSubstr("moved"));
  plan_.lit[0].push_back(plan_.lit[1][0]);
  EXPECT_THAT(WhyNot(), HasSubstr("several exposures"));
  plan_.lit[0] = {FrameFile{.path = "a.exr"}};
  EXPECT_THAT(WhyNot(), HasSubstr("not camera RAW"));
}

// The same radiance as in the domain of colours, where a site keeps its own value.
TEST_F(MosaicLoader, RadianceIsThatOfInterpolatedColoursAtTheSitesOwn) {
  testing::WriteText(temp_.Path() / "lights.txt", testing::Lines(kDirections));
  for (int k = 4; k < 6; ++k) {
    std::filesystem::remove(Path(k));
  }
  const Dataset rgb = ReadDataset(temp_.Path(), {}).value();
  const Dataset raw =
      ReadDataset(temp_.Path(), {.domain = Domain::kRaw, .by_noise = false}).value();
  ASSERT_TRUE(raw.mosaics);
  EXPECT_TRUE(raw.stack.empty());
  EXPECT_EQ(raw.Size(), rgb.Size());
  EXPECT_EQ(raw.sha256_of_input, rgb.sha256_of_input);
  const std::vector<uint16_t> readings = AllOf(*raw.mosaics, 2);
  const MosaicFrame& frame = raw.mosaics->stack.lit[2];
  for (size_t p = 0; p < readings.size(); p += 37) {
    const size_t x = p % static_cast<size_t>(raw.Size().width);
    const size_t y = p / static_cast<size_t>(raw.Size().width);
    const size_t site = y % 2 * 2 + x % 2;
    const float expected = rgb.stack[2].rgb[raw.mosaics->stack.cfa[site]].pixels[p];
    if (expected < 1.0F) {
      ASSERT_NEAR(frame.per_dn[site] * static_cast<float>(readings[p]) + frame.at_zero[site],
                  expected, 1e-5F);
    }
  }
  // Nothing tells of the noise but what the solve itself will find.
  EXPECT_FALSE(ReadDataset(temp_.Path(), {.domain = Domain::kRaw}).value().mosaics->noise);
}

}  // namespace
}  // namespace sateen::mosaic_loader_test
