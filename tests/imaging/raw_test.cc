#include "imaging/raw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/testing/files.h"

namespace sateen {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

constexpr std::array<std::array<uint8_t, 4>, 4> kBayerOrders = {
    {{0, 1, 1, 2}, {2, 1, 1, 0}, {1, 0, 2, 1}, {1, 2, 0, 1}}};

// ---- A DNG written by hand, so that every number that must come back is known ----

struct Entry {
  uint16_t tag;
  uint16_t type;  // 1 BYTE, 2 ASCII, 3 SHORT, 4 LONG, 5 RATIONAL
  std::vector<uint32_t> values;
};

void Append(std::string& bytes, uint32_t value, size_t width) {
  for (size_t i = 0; i < width; ++i) {
    bytes += static_cast<char>(value >> (8 * i) & 0xFF);
  }
}

std::vector<uint32_t> Text(const std::string& text) {
  std::vector<uint32_t> values(text.begin(), text.end());
  values.push_back(0);
  return values;
}

// One TIFF directory that starts at `offset`, with what does not fit in its entries after it.
std::string Directory(const std::vector<Entry>& entries, size_t offset) {
  std::string table;
  std::string rest;
  Append(table, static_cast<uint32_t>(entries.size()), 2);
  const size_t rest_offset = offset + 2 + 12 * entries.size() + 4;
  for (const Entry& entry : entries) {
    const size_t width = entry.type <= 2 ? 1 : entry.type == 3 ? 2 : 4;
    const size_t count = entry.type == 5 ? entry.values.size() / 2 : entry.values.size();
    Append(table, entry.tag, 2);
    Append(table, entry.type, 2);
    Append(table, static_cast<uint32_t>(count), 4);
    std::string values;
    for (const uint32_t value : entry.values) {
      Append(values, value, width);
    }
    values.resize((values.size() + 3) / 4 * 4);
    if (values.size() > 4) {
      Append(table, static_cast<uint32_t>(rest_offset + rest.size()), 4);
      rest += values;
    } else {
      values.resize(4);
      table += values;
    }
  }
  Append(table, 0, 4);
  return table + rest;
}

struct DngSpec {
  uint32_t width = 66;
  uint32_t height = 50;
  std::vector<uint32_t> cfa = {0, 1, 1, 2};
  uint32_t cfa_side = 2;
  uint32_t colours = 1;                 // 3 writes a linear DNG
  std::vector<uint32_t> black = {100};  // 1 or 4 values
  uint32_t white = 4000;
  std::vector<uint32_t> active_area = {};  // top, left, bottom, right
  bool with_exposure = true;
};

// The sensor reading at a site, in DN.
uint16_t Reading(uint32_t x, uint32_t y) {
  return static_cast<uint16_t>(50 + (x * 37 + y * 101) % 3900);
}

std::string DngBytes(const DngSpec& spec) {
  std::string pixels;
  for (uint32_t y = 0; y < spec.height; ++y) {
    for (uint32_t x = 0; x < spec.width * spec.colours; ++x) {
      Append(pixels, Reading(x, y), 2);
    }
  }
  const auto pixels_offset = uint32_t{8};
  const auto exif_offset = static_cast<uint32_t>(8 + pixels.size());
  const std::string exif =
      Directory({{33434, 5, {1, 50}}, {33437, 5, {56, 10}}, {34855, 3, {200}}}, exif_offset);
  std::vector<Entry> entries = {
      {254, 4, {0}},
      {256, 4, {spec.width}},
      {257, 4, {spec.height}},
      {258, 3, std::vector<uint32_t>(spec.colours, 16)},
      {259, 3, {1}},
      {262, 3, {spec.colours == 1 ? 32803U : 34892U}},
      {271, 2, Text("Sateen")},
      {272, 2, Text("Test Camera")},
      {273, 4, {pixels_offset}},
      {277, 3, {spec.colours}},
      {278, 4, {spec.height}},
      {279, 4, {static_cast<uint32_t>(pixels.size())}},
  };
  if (spec.colours == 1) {
    entries.push_back({33421, 3, {spec.cfa_side, spec.cfa_side}});
    entries.push_back({33422, 1, spec.cfa});
  }
  if (spec.with_exposure) {
    entries.push_back({34665, 4, {exif_offset}});
  }
  entries.push_back({50706, 1, {1, 4, 0, 0}});
  entries.push_back({50708, 2, Text("Sateen Test Camera")});
  const uint32_t black_side = spec.black.size() == 4 ? 2 : 1;
  entries.push_back({50713, 3, {black_side, black_side}});
  entries.push_back({50714, 4, spec.black});
  entries.push_back({50717, 4, {spec.white}});
  entries.push_back({50728, 5, {1, 2, 1, 1, 4, 5}});  // neutral 0.5, 1, 0.8
  if (!spec.active_area.empty()) {
    entries.push_back({50829, 4, spec.active_area});
  }
  std::string bytes("II*\0", 4);
  Append(bytes, static_cast<uint32_t>(exif_offset + exif.size()), 4);
  return bytes + pixels + exif + Directory(entries, exif_offset + exif.size());
}

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

TEST(ReadRawMosaic, CountsSitesFromTheVisibleOrigin) {
  DngSpec spec;
  spec.active_area = {4, 6, 48, 62};
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
  for (int round = 0; round < 2000; ++round) {
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

// ---- Demosaic ----

// Samples `rgb` through the colour filters.
template <typename Rgb>
RawMosaic Mosaic(ImageSize size, const std::array<uint8_t, 4>& cfa, Rgb rgb) {
  RawMosaic mosaic;
  mosaic.cfa = cfa;
  mosaic.samples = Image<float>(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      mosaic.samples.At(x, y) = rgb(x, y, cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]);
    }
  }
  return mosaic;
}

TEST(Demosaic, IsExactOnLinearRampsAwayFromTheBorder) {
  // Multiples of 1/256: every sum and half of them is exact in float.
  const auto ramp = [](int x, int y, int c) {
    return static_cast<float>((c + 1) * 40 + x * (3 - c) + y * (2 * c - 1)) / 256.0F;
  };
  for (const auto& cfa : kBayerOrders) {
    const Image3 rgb = Demosaic(Mosaic({14, 11}, cfa, ramp));
    for (int y = 1; y < 10; ++y) {
      for (int x = 1; x < 13; ++x) {
        for (int c = 0; c < 3; ++c) {
          ASSERT_EQ(rgb[static_cast<size_t>(c)].At(x, y), ramp(x, y, c))
              << x << ' ' << y << ' ' << c;
        }
      }
    }
  }
}

TEST(Demosaic, IsExactOnConstantsUpToTheBorder) {
  const auto constant = [](int, int, int c) { return 0.1F + 0.3F * static_cast<float>(c); };
  for (const auto& cfa : kBayerOrders) {
    for (const ImageSize size : {ImageSize{2, 2}, {3, 2}, {2, 5}, {7, 6}}) {
      const Image3 rgb = Demosaic(Mosaic(size, cfa, constant));
      for (size_t c = 0; c < 3; ++c) {
        for (const float value : rgb[c].pixels) {
          ASSERT_EQ(value, constant(0, 0, static_cast<int>(c)));
        }
      }
    }
  }
}

TEST(Demosaic, KeepsMeasuredValues) {
  std::mt19937 random(3);
  for (const auto& cfa : kBayerOrders) {
    const RawMosaic mosaic = Mosaic({9, 8}, cfa, [&random](int, int, int) {
      return std::uniform_real_distribution<float>(-0.1F, 1.1F)(random);
    });
    const Image3 rgb = Demosaic(mosaic);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 9; ++x) {
        ASSERT_EQ(rgb[cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]].At(x, y),
                  mosaic.samples.At(x, y));
      }
    }
  }
}

TEST(Demosaic, SpreadsOneSiteToItsNeighboursOnly) {
  // A red site of 1 gives half to its side neighbours and a quarter to its corner neighbours.
  RawMosaic mosaic = Mosaic({8, 8}, {0, 1, 1, 2}, [](int, int, int) { return 0.0F; });
  mosaic.samples.At(4, 4) = 1.0F;
  const Image3 rgb = Demosaic(mosaic);
  double sum = 0.0;
  for (const float value : rgb[0].pixels) {
    sum += static_cast<double>(value);
  }
  EXPECT_EQ(rgb[0].At(3, 4), 0.5F);
  EXPECT_EQ(rgb[0].At(4, 5), 0.5F);
  EXPECT_EQ(rgb[0].At(5, 3), 0.25F);
  EXPECT_EQ(sum, 4.0);
  EXPECT_EQ(*std::ranges::max_element(rgb[1].pixels), 0.0F);
}

float MedianAround(const Image<float>& plane, int x, int y) {
  std::vector<float> values;
  for (int dy = -15; dy <= 15; ++dy) {
    for (int dx = -15; dx <= 15; ++dx) {
      values.push_back(plane.At(x + dx, y + dy));
    }
  }
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

TEST(Demosaic, ShowsTheGreysOfARealChartInOrder) {
  SATEEN_NEEDS_DATA("raw");
  const Result<RawMosaic> mosaic = ReadRawMosaic(testing::DataDir() / "raw" / "colorchart.dng");
  ASSERT_TRUE(mosaic) << mosaic.error().message;
  // Noise reads a little below black, the brightest window well below white.
  EXPECT_GE(*std::ranges::min_element(mosaic->samples.pixels), -0.02F);
  EXPECT_LE(*std::ranges::max_element(mosaic->samples.pixels), 1.0F);
  const Image3 rgb = Demosaic(*mosaic);

  constexpr int kPatches[6][2] = {{703, 929},  {811, 928},  {921, 928},
                                  {1033, 924}, {1144, 921}, {1259, 920}};
  // Density of the ColorChecker's grey row: 0.05 to 1.50, as reflectance.
  constexpr float kReflectance[6] = {0.900F, 0.591F, 0.362F, 0.198F, 0.090F, 0.031F};
  const float white = MedianAround(rgb[1], kPatches[0][0], kPatches[0][1]);
  EXPECT_GT(white, 0.05F);
  for (int i = 0; i < 6; ++i) {
    const float grey = MedianAround(rgb[1], kPatches[i][0], kPatches[i][1]);
    std::printf("%d %g %g\n", i, grey/white, kReflectance[i]/kReflectance[0]);
    // Uneven light and flare of an unprepared room: a twentieth of the white patch.
    EXPECT_NEAR(grey / white, kReflectance[i] / kReflectance[0], 0.05F) << i;
  }
  // The red patch is red: the colours of the pattern are not mixed up.
  EXPECT_GT(MedianAround(rgb[0], 925, 822), 1.2F * MedianAround(rgb[1], 925, 822));
}

}  // namespace
}  // namespace sateen
