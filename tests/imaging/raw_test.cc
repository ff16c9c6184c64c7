#include "imaging/raw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>

#include "tests/imaging/dng.h"
#include "tests/testing/files.h"

namespace sateen::raw_test {
namespace {

using testing::DngBytes;
using testing::DngSpec;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kBayerOrders;
using testing::Reading;
using testing::TempFolder;
using testing::WriteText;

Result<RawMosaic> ReadDng(const DngSpec& spec) {
  const TempFolder folder;
  WriteText(folder.Path() / "a.dng", DngBytes(spec));
  return ReadRawMosaic(folder.Path() / "a.dng");
}

TEST(ReadRawMosaic, GivesEverySiteAsAFractionBetweenBlackAndWhite) {
  for (const auto& cfa : kBayerOrders) {
    DngSpec spec;
    spec.cfa.assign(cfa.begin(), cfa.end());
    const Result<RawMosaic> mosaic = ReadDng(spec);
    ASSERT_TRUE(mosaic) << mosaic.error().message;
    ASSERT_EQ(mosaic->samples.Size(), (ImageSize{66, 50}));
    EXPECT_EQ(mosaic->cfa, cfa);
    EXPECT_EQ(mosaic->black, 100.0F);
    EXPECT_EQ(mosaic->white, 4000.0F);
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 66; ++x) {
        const float reading = Reading(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
        ASSERT_EQ(mosaic->samples.At(x, y), (reading - 100.0F) / 3900.0F) << x << ' ' << y;
      }
    }
    EXPECT_LT(mosaic->samples.At(0, 0), 0.0F);  // 50 DN: below black stays negative
  }
}

TEST(ReadRawMosaic, TakesBlackSiteBySite) {
  DngSpec spec;
  spec.black = {100, 200, 300, 500};
  spec.black_columns = 2;
  const Result<RawMosaic> mosaic = ReadDng(spec);
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  EXPECT_EQ(mosaic->black, 275.0F);
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 66; ++x) {
      const float black = static_cast<float>(spec.black[static_cast<size_t>(y % 2 * 2 + x % 2)]);
      const float reading = Reading(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
      ASSERT_EQ(mosaic->samples.At(x, y), (reading - black) / (4000.0F - black)) << x << ' ' << y;
    }
  }
}

TEST(ReadRawMosaic, TakesBlackRowByRowAndColumnByColumn) {
  const auto expected = [](int x, int y, float black) {
    const float reading = Reading(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
    return (reading - black) / (4000.0F - black);
  };
  DngSpec spec;
  spec.black = {100, 300};
  for (const uint32_t columns : {1U, 2U}) {
    spec.black_columns = columns;
    const Result<RawMosaic> mosaic = ReadDng(spec);
    ASSERT_TRUE(mosaic) << mosaic.error().message;
    EXPECT_EQ(mosaic->black, 200.0F);
    EXPECT_EQ(mosaic->samples.At(7, 8), expected(7, 8, columns == 1 ? 100.0F : 300.0F));
    EXPECT_EQ(mosaic->samples.At(8, 7), expected(8, 7, columns == 1 ? 300.0F : 100.0F));
  }
}

TEST(ReadRawMosaic, CountsSitesFromTheVisibleOrigin) {
  DngSpec spec;
  spec.active_area = {4, 6, 48, 62};
  spec.black_columns = 2;
  spec.black = {100, 200, 300, 500};  // DNG: the pattern starts at the active area's corner
  const Result<RawMosaic> mosaic = ReadDng(spec);
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  ASSERT_EQ(mosaic->samples.Size(), (ImageSize{56, 44}));
  EXPECT_THAT(mosaic->cfa, ElementsAre(0, 1, 1, 2));
  EXPECT_EQ(mosaic->samples.At(0, 0), (static_cast<float>(Reading(6, 4)) - 100.0F) / 3900.0F);
  EXPECT_EQ(mosaic->samples.At(55, 43), (static_cast<float>(Reading(61, 47)) - 500.0F) / 3500.0F);
}

TEST(ReadRawMosaic, ReadsWhatTheCameraWroteDown) {
  const Result<RawMosaic> mosaic = ReadDng({});
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  EXPECT_EQ(mosaic->camera, "Sateen Test Camera");
  EXPECT_NEAR(mosaic->exposure_s.value(), 0.02, 1e-9);  // LibRaw keeps floats
  EXPECT_NEAR(mosaic->f_number.value(), 5.6, 1e-6);
  EXPECT_EQ(mosaic->iso, 200.0);
  // 1 / neutral, by green.
  EXPECT_NEAR(mosaic->camera_white_balance[0], 2.0F, 1e-6F);
  EXPECT_EQ(mosaic->camera_white_balance[1], 1.0F);
  EXPECT_NEAR(mosaic->camera_white_balance[2], 1.25F, 1e-6F);

  DngSpec silent;
  silent.with_exposure = false;
  const RawMosaic bare = ReadDng(silent).value();
  EXPECT_FALSE(bare.exposure_s || bare.f_number || bare.iso);
}

void ExpectBad(const Result<RawMosaic>& mosaic, const std::string& words) {
  ASSERT_FALSE(mosaic) << words;
  EXPECT_EQ(mosaic.error().code, ErrorCode::kBadData);
  EXPECT_THAT(mosaic.error().message, HasSubstr(words));
}

TEST(ReadRawMosaic, RefusesWhatIsNotABayerMosaic) {
  DngSpec linear;
  linear.colours = 3;
  ExpectBad(ReadDng(linear), "three colours at every pixel");

  DngSpec xtrans;
  xtrans.cfa_side = 6;
  xtrans.cfa = {1, 1, 0, 1, 1, 2, 1, 1, 2, 1, 1, 0, 2, 0, 1, 0, 2, 1,
                1, 1, 2, 1, 1, 0, 1, 1, 0, 1, 1, 2, 0, 2, 1, 2, 0, 1};
  ExpectBad(ReadDng(xtrans), "X-Trans");

  DngSpec columns;
  columns.cfa = {0, 1, 0, 2};
  ExpectBad(ReadDng(columns), "needed is a 2x2 Bayer mosaic");
}

TEST(ReadRawMosaic, RefusesBlackThatIsNotBelowWhite) {
  DngSpec spec;
  spec.black = {4000};
  ExpectBad(ReadDng(spec), "black level 4000 is not below its white level 4000");
}

TEST(ReadRawMosaic, RefusesSizesThatTheFileCannotHold) {
  const TempFolder folder;
  std::string bytes = DngBytes({});
  for (const char tag : {'\x00', '\x01'}) {  // width and height: tags 256 and 257, one LONG each
    const size_t entry = bytes.find(std::string({tag, 1, 4, 0, 1, 0, 0, 0}));
    ASSERT_NE(entry, std::string::npos);
    bytes.replace(entry + 8, 4, std::string("\x60\xEA\0\0", 4));
  }
  WriteText(folder.Path() / "a.dng", bytes);

  ExpectBad(ReadRawMosaic(folder.Path() / "a.dng"), "its header says 60000 x 60000 pixels");
}

TEST(ReadRawMosaic, TellsAbsentFromBad) {
  const TempFolder folder;
  const Result<RawMosaic> absent = ReadRawMosaic(folder.Path() / "absent.dng");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::kIo);
  EXPECT_THAT(absent.error().message, HasSubstr("absent.dng: no such file"));

  WriteText(folder.Path() / "text.nef", std::string(100, 'x'));
  ExpectBad(ReadRawMosaic(folder.Path() / "text.nef"), "text.nef: cannot be decoded as camera RAW");
  WriteText(folder.Path() / "empty.nef", "");
  ExpectBad(ReadRawMosaic(folder.Path() / "empty.nef"), "empty.nef: is empty");
}

TEST(ReadRawMosaic, RefusesFilesCutShortAtAnyLength) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "a.dng";
  const std::string bytes = DngBytes({});
  for (size_t kept = 0; kept<bytes.size(); kept += kept> 64 && kept + 600 < bytes.size() ? 41 : 1) {
    WriteText(path, bytes.substr(0, kept));
    const Result<RawMosaic> mosaic = ReadRawMosaic(path);
    ASSERT_FALSE(mosaic) << kept << " of " << bytes.size();
    ASSERT_EQ(mosaic.error().code, ErrorCode::kBadData);
    ASSERT_THAT(mosaic.error().message, HasSubstr(path.string()));
  }
}

TEST(ReadRawMosaic, SurvivesDamagedBytes) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "a.dng";
  const std::string whole = DngBytes({});
  const size_t tables = whole.size() - 450;  // the directories and their values
  std::mt19937 random(7);
  for (int round = 0; round < 300; ++round) {
    std::string bytes = whole;
    for (int i = 0; i < 3; ++i) {
      bytes[tables + random() % 450] = static_cast<char>(random());
    }
    WriteText(path, bytes);
    const Result<RawMosaic> mosaic = ReadRawMosaic(path);
    ASSERT_TRUE(mosaic || mosaic.error().code == ErrorCode::kBadData);
  }
}

TEST(ReadRawMosaic, RefusesTheCorruptCollection) {
  SATEEN_NEEDS_DATA("raw");
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(testing::DataDir() / "raw" / "corrupt")) {
    ASSERT_TRUE(IsRawName(entry.path()));
    ExpectBad(ReadRawMosaic(entry.path()), entry.path().filename().string());
    ++files;
  }
  EXPECT_EQ(files, 5);
}

TEST(ReadRawMosaic, ReadsARealPhotographOfAChart) {
  SATEEN_NEEDS_DATA("raw");
  const Result<RawMosaic> mosaic = ReadRawMosaic(testing::DataDir() / "raw" / "colorchart.dng");
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  ASSERT_EQ(mosaic->samples.Size(), (ImageSize{1734, 1156}));
  EXPECT_THAT(mosaic->cfa, ElementsAre(0, 1, 1, 2));
  EXPECT_EQ(mosaic->black, 2056.0F);  // BlackLevel and WhiteLevel of the file
  EXPECT_EQ(mosaic->white, 15000.0F);
  EXPECT_EQ(mosaic->camera, "Canon EOS Kiss X4");
  EXPECT_EQ(mosaic->exposure_s, 1.0);
  EXPECT_EQ(mosaic->f_number, 1.0);
  EXPECT_FALSE(mosaic->iso);
}

TEST(ReadRawMosaic, RefusesTheChartCutShort) {
  SATEEN_NEEDS_DATA("raw");
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "chart.dng";
  std::filesystem::copy_file(testing::DataDir() / "raw" / "colorchart.dng", path);
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  for (std::uintmax_t kept = std::filesystem::file_size(path) - 1; kept > 1000; kept /= 2) {
    testing::CutShort(path, kept);
    ExpectBad(ReadRawMosaic(path), "is cut short");
  }
}

}  // namespace
}  // namespace sateen::raw_test
