#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <libraw/libraw.h>

#include <cmath>
#include <iterator>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "core/files/file_io.h"
#include "imaging/dng.h"
#include "imaging/raw.h"
#include "tests/imaging/dng.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"

namespace sateen::dng_write_test {
namespace {

using testing::FullDisk;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kBayerOrders;
using testing::TempFolder;

namespace fs = std::filesystem;

// Any 16-bit readings, with the telling ones first; 16-bit also where white is lower.
Image<uint16_t> Readings(ImageSize size, const DngHeader& header, uint32_t seed) {
  Image<uint16_t> mosaic(size);
  std::mt19937 random(seed);
  for (uint16_t& value : mosaic.pixels) {
    value = static_cast<uint16_t>(random());
  }
  mosaic.pixels[0] = 0;
  mosaic.pixels[1] = static_cast<uint16_t>(header.black);
  mosaic.pixels[2] = static_cast<uint16_t>(header.white);
  mosaic.pixels[3] = 65535;
  return mosaic;
}

DngHeader HeaderOf(const std::array<uint8_t, 4>& cfa, double black, double white) {
  DngHeader header;
  header.cfa = cfa;
  header.black = black;
  header.white = white;
  header.make = "Sateen";
  header.model = "Test Camera";
  header.neutral = {0.5, 1.0, 0.8};
  header.exposure_s = 0.02;
  header.f_number = 5.6;
  header.iso = 200.0;
  return header;
}

class WriteDngTest : public ::testing::Test {
 protected:
  // Writes and hands back the file's bytes.
  std::string BytesOf(const Image<uint16_t>& mosaic, const DngHeader& header,
                      const std::string& name = "bytes.dng") {
    const fs::path path = folder_.Path() / name;
    const Status status = WriteDng(path, mosaic, header);
    EXPECT_TRUE(status) << status.error().message;
    return ReadFileBytes(path).value_or("");
  }

  void ExpectSameInLibRaw(const fs::path& path, const Image<uint16_t>& mosaic) {
    const auto raw = std::make_unique<LibRaw>(LIBRAW_OPTIONS_NONE);
    ASSERT_EQ(raw->open_file(path.c_str()), LIBRAW_SUCCESS);
    ASSERT_EQ(raw->unpack(), LIBRAW_SUCCESS);
    const libraw_image_sizes_t& sizes = raw->imgdata.sizes;
    ASSERT_EQ((ImageSize{sizes.raw_width, sizes.raw_height}), mosaic.Size());
    ASSERT_NE(raw->imgdata.rawdata.raw_image, nullptr);
    for (int y = 0; y < mosaic.height; ++y) {
      for (int x = 0; x < mosaic.width; ++x) {
        const size_t at =
            static_cast<size_t>(y) * (sizes.raw_pitch / sizeof(uint16_t)) + static_cast<size_t>(x);
        ASSERT_EQ(raw->imgdata.rawdata.raw_image[at], mosaic.At(x, y)) << x << ' ' << y;
      }
    }
  }

  void ExpectSameInOurs(const fs::path& path, const Image<uint16_t>& mosaic,
                        const DngHeader& header) {
    const Result<RawMosaic> read = ReadRawMosaic(path);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->samples.Size(), mosaic.Size());
    EXPECT_EQ(read->cfa, header.cfa);
    const auto black = static_cast<float>(header.black);
    const auto white = static_cast<float>(header.white);
    EXPECT_EQ(read->black, black);
    EXPECT_EQ(read->white, white);
    for (size_t p = 0; p < mosaic.pixels.size(); ++p) {
      const auto reading = static_cast<float>(mosaic.pixels[p]);
      ASSERT_EQ(read->samples.pixels[p], (reading - black) / (white - black)) << p;
    }
  }

  [[nodiscard]] fs::path Path(const std::string& name) const { return folder_.Path() / name; }

 private:
  TempFolder folder_;
};

TEST_F(WriteDngTest, EveryReadingComesBack) {
  uint32_t seed = 1;
  for (const auto& cfa : kBayerOrders) {
    for (const double white : {4095.0, 16383.0, 65535.0}) {
      for (const ImageSize size : {ImageSize{66, 50}, {67, 51}, {67, 50}, {66, 51}}) {
        SCOPED_TRACE(fmt::format("cfa {} {} white {} {}x{}", cfa[0], cfa[1], white, size.width,
                                 size.height));
        const DngHeader header = HeaderOf(cfa, 256.0, white);
        const Image<uint16_t> mosaic = Readings(size, header, ++seed);
        const Status status = WriteDng(Path("a.dng"), mosaic, header);
        ASSERT_TRUE(status) << status.error().message;
        ASSERT_NO_FATAL_FAILURE(ExpectSameInLibRaw(Path("a.dng"), mosaic));
        ASSERT_NO_FATAL_FAILURE(ExpectSameInOurs(Path("a.dng"), mosaic, header));
      }
    }
  }
}

TEST_F(WriteDngTest, BlackOfZeroAndBlackJustBelowWhiteComeBack) {
  for (const double black : {0.0, 16382.0}) {
    const DngHeader header = HeaderOf({0, 1, 1, 2}, black, 16383.0);
    const Image<uint16_t> mosaic = Readings({40, 30}, header, 3);
    ASSERT_TRUE(WriteDng(Path("a.dng"), mosaic, header));
    ASSERT_NO_FATAL_FAILURE(ExpectSameInOurs(Path("a.dng"), mosaic, header));
  }
}

TEST_F(WriteDngTest, WhatTheCameraWroteDownComesBack) {
  const DngHeader header = HeaderOf({0, 1, 1, 2}, 512.0, 16383.0);
  ASSERT_TRUE(WriteDng(Path("a.dng"), Readings({40, 30}, header, 1), header));

  const RawMosaic read = ReadRawMosaic(Path("a.dng")).value();
  EXPECT_EQ(read.camera, "Sateen Test Camera");
  EXPECT_NEAR(read.exposure_s.value(), 0.02, 1e-9);  // LibRaw keeps floats
  EXPECT_NEAR(read.f_number.value(), 5.6, 1e-6);
  EXPECT_EQ(read.iso, 200.0);
  // 1 / neutral, by green.
  EXPECT_NEAR(read.camera_white_balance[0], 2.0F, 1e-6F);
  EXPECT_EQ(read.camera_white_balance[1], 1.0F);
  EXPECT_NEAR(read.camera_white_balance[2], 1.25F, 1e-6F);
}

TEST_F(WriteDngTest, ExposureKeepsFloatPrecisionOverItsRange) {
  for (const double exposure_s : {1e-6, 1.0 / 8000.0, 1.0 / 3.0, 0.123456, 2.5, 30.0, 1e5}) {
    DngHeader header = HeaderOf({0, 1, 1, 2}, 0.0, 65535.0);
    header.exposure_s = exposure_s;
    ASSERT_TRUE(WriteDng(Path("a.dng"), Readings({40, 30}, header, 1), header));
    const RawMosaic read = ReadRawMosaic(Path("a.dng")).value();
    EXPECT_NEAR(read.exposure_s.value(), exposure_s, 2e-7 * exposure_s);
  }
}

TEST_F(WriteDngTest, WhatIsNotGivenIsNotInTheFile) {
  DngHeader header;
  const Image<uint16_t> mosaic = Readings({40, 30}, header, 1);
  ASSERT_TRUE(WriteDng(Path("a.dng"), mosaic, header));
  const RawMosaic bare = ReadRawMosaic(Path("a.dng")).value();
  EXPECT_FALSE(bare.exposure_s || bare.f_number || bare.iso);
  ASSERT_NO_FATAL_FAILURE(ExpectSameInOurs(Path("a.dng"), mosaic, header));

  header.iso = 65535.0;
  ASSERT_TRUE(WriteDng(Path("a.dng"), mosaic, header));
  EXPECT_EQ(ReadRawMosaic(Path("a.dng")).value().f_number, std::nullopt);
}

TEST_F(WriteDngTest, ColourMatrixAndDateReachLibRaw) {
  DngHeader header = HeaderOf({0, 1, 1, 2}, 0.0, 65535.0);
  header.color_matrix = {0.9, -0.3, -0.1, -0.4, 1.2, 0.2, -0.05, 0.15, 0.6};
  header.date_time = "2026:03:04 05:06:07";
  const std::string bytes = BytesOf(Readings({40, 30}, header, 1), header);

  const size_t of_exif = bytes.find("2026:03:04 05:06:07");
  const size_t of_picture = bytes.rfind("2026:03:04 05:06:07");
  EXPECT_TRUE(of_exif < of_picture && of_picture != std::string::npos);
  const auto raw = std::make_unique<LibRaw>(LIBRAW_OPTIONS_NONE);
  ASSERT_EQ(raw->open_file(Path("bytes.dng").c_str()), LIBRAW_SUCCESS);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(raw->imgdata.color.dng_color[0].colormatrix[i / 3][i % 3], header.color_matrix[i],
                1e-6);
  }
  EXPECT_EQ(raw->imgdata.color.dng_color[0].illuminant, 21);  // D65
}

TEST_F(WriteDngTest, SameInputGivesSameBytesFromAnyThread) {
  DngHeader header = HeaderOf({1, 0, 2, 1}, 64.0, 4095.0);
  header.date_time = "2026:03:04 05:06:07";
  const Image<uint16_t> mosaic = Readings({120, 90}, header, 9);
  const std::string first = BytesOf(mosaic, header);
  EXPECT_LT(first.size(), mosaic.pixels.size() * 2 + 1024);  // all within the room reserved

  std::vector<std::string> others(4);
  std::vector<std::thread> threads;
  for (size_t i = 0; i < others.size(); ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 10; ++round) {
        others[i] = BytesOf(mosaic, header, "thread" + std::to_string(i) + ".dng");
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (const std::string& bytes : others) {
    EXPECT_EQ(bytes, first);
  }
}

TEST_F(WriteDngTest, PrintsNothing) {
  DngHeader header = HeaderOf({1, 0, 2, 1}, 64.0, 4095.0);
  header.date_time = "2026:03:04 05:06:07";
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  const Status status = WriteDng(Path("a.dng"), Readings({31, 23}, header, 9), header);
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), IsEmpty());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
  EXPECT_TRUE(status);
}

void ExpectRefused(const Status& status, const std::string& words) {
  ASSERT_FALSE(status) << words;
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr(words));
}

// A header with one thing changed.
template <typename Change>
Status Checked(Change change) {
  DngHeader header;
  change(header);
  return header.Validate();
}

TEST(DngHeader, RefusesLevelsThatAreNone) {
  EXPECT_TRUE(DngHeader().Validate());
  const auto levels = [](double black, double white) {
    return Checked([=](DngHeader& h) { h.black = black, h.white = white; });
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused(levels(4095, 4095), "black = 4095; need less than white = 4095");
  ExpectRefused(levels(4096, 4095), "black = 4096; need less than white = 4095");
  ExpectRefused(levels(-1, 4095), "black = -1; need a whole number from 0");
  ExpectRefused(levels(64.5, 4095), "black = 64.5; need a whole");
  ExpectRefused(levels(kNan, 4095), "black = nan");
  ExpectRefused(levels(0, 65536), "white = 65536; need a whole number from 1 to 65535");
  ExpectRefused(levels(0, 4095.5), "white = 4095.5");
  ExpectRefused(levels(0, kNan), "white = nan");
}

TEST(DngHeader, RefusesWhatIsNoBayerOrder) {
  for (const auto& cfa : kBayerOrders) {
    EXPECT_TRUE(Checked([&](DngHeader& h) { h.cfa = cfa; }));
  }
  const auto order = [](std::array<uint8_t, 4> cfa) {
    return Checked([=](DngHeader& h) { h.cfa = cfa; });
  };
  ExpectRefused(order({0, 1, 0, 2}), "cfa = 0 1 0 2; need");
  ExpectRefused(order({1, 1, 1, 1}), "cfa");
  ExpectRefused(order({0, 1, 1, 0}), "cfa");
  ExpectRefused(order({3, 1, 1, 2}), "cfa");
  ExpectRefused(order({0, 1, 1, 3}), "cfa");
  ExpectRefused(order({1, 0, 0, 1}), "cfa");
  ExpectRefused(order({0, 1, 2, 1}), "cfa");
}

TEST(DngHeader, RefusesWhatTheFileCannotSay) {
  ExpectRefused(Checked([](DngHeader& h) { h.make = ""; }), "make = ''; need 1 to 63");
  ExpectRefused(Checked([](DngHeader& h) { h.model = std::string(64, 'x'); }), "model = 'xx");
  ExpectRefused(Checked([](DngHeader& h) { h.model = "a\n"; }), "model");
  ExpectRefused(Checked([](DngHeader& h) { h.make = "Käm"; }), "make");
  ExpectRefused(Checked([](DngHeader& h) { h.make = "Sateen "; }), "make");
  ExpectRefused(Checked([](DngHeader& h) { h.color_matrix[8] = HUGE_VAL; }), "color_matrix = inf");
  ExpectRefused(Checked([](DngHeader& h) { h.neutral[2] = 0.0; }), "neutral = 0; need 0.0001");
  ExpectRefused(Checked([](DngHeader& h) { h.exposure_s = 0.0; }), "exposure_s = 0; need 1e-06");
  ExpectRefused(Checked([](DngHeader& h) { h.f_number = -2.0; }), "f_number = -2");
  ExpectRefused(Checked([](DngHeader& h) { h.iso = 0.0; }), "iso = 0; need a whole number");
  ExpectRefused(Checked([](DngHeader& h) { h.iso = 100.5; }), "iso = 100.5");
  for (const char* date : {"", "2026-03-04 05:06:07", "2026:13:04 05:06:07", "2026:03:00 05:06:07",
                           "2026:03:04 24:06:07", "2026:03:04 05:06:07Z", "2026:03:04 05:60:07"}) {
    ExpectRefused(Checked([=](DngHeader& h) { h.date_time = date; }), "date_time = '");
  }
  EXPECT_TRUE(Checked([](DngHeader& h) { h.date_time = "2026:12:31 23:59:59"; }));
}

TEST_F(WriteDngTest, RefusesSizesThatAreNoMosaic) {
  for (const ImageSize size : {ImageSize{1, 30}, {30, 1}, {0, 0}, {65536, 2}}) {
    ExpectRefused(WriteDng(Path("a.dng"), Image<uint16_t>(size), {}),
                  fmt::format("the mosaic is {}x{} px; need 2", size.width, size.height));
  }
  DngHeader bad;
  bad.black = 65535.0;
  ExpectRefused(WriteDng(Path("a.dng"), Image<uint16_t>(40, 30), bad), "black");
  EXPECT_FALSE(fs::exists(Path("a.dng")));
  EXPECT_TRUE(WriteDng(Path("a.dng"), Image<uint16_t>(2, 2), {}));
}

TEST_F(WriteDngTest, AFolderThatIsNotThereIsAnIoError) {
  const Status status = WriteDng(Path("nowhere/a.dng"), Image<uint16_t>(40, 30), {});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr("nowhere"));
}

TEST_F(WriteDngTest, AFullDiskLeavesTheFormerFile) {
  const Image<uint16_t> mosaic(200, 100);
  const std::string before = BytesOf(mosaic, {}, "a.dng");
  Status status;
  {
    const FullDisk full(4000);
    status = WriteDng(Path("a.dng"), Image<uint16_t>(200, 100, 7), {});
  }
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr("a.dng"));
  EXPECT_EQ(ReadFileBytes(Path("a.dng")).value(), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(Path("")), {}), 1);
}

}  // namespace
}  // namespace sateen::dng_write_test
