#include "imaging/file_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/imaging/dng.h"
#include "tests/testing/files.h"

namespace sateen::file_check_test {
namespace {

using testing::Append;
using testing::Directory;
using testing::Entry;
using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

// A TIFF of 40 x 30 pixels in tiles of 16 x 16 with 10 bytes each, from byte 200 on.
std::string TiledTiff(uint32_t tiles_listed) {
  Entry offsets{324, 4, {}};
  Entry lengths{325, 3, {}};
  for (uint32_t i = 0; i < tiles_listed; ++i) {
    offsets.values.push_back(200 + 10 * i);
    lengths.values.push_back(10);
  }
  std::string bytes("II*\0", 4);
  Append(bytes, 8, 4);
  bytes += Directory(
      {{256, 3, {40}}, {257, 3, {30}}, {322, 3, {16}}, {323, 3, {16}}, offsets, lengths}, 8);
  bytes.resize(200);
  bytes.resize(200 + 10 * tiles_listed, 'x');
  return bytes;
}

Status CheckTiff(const std::string& bytes) {
  const TempFolder folder;
  WriteText(folder.Path() / "a.tif", bytes);
  return InputFile::Open(folder.Path() / "a.tif").and_then(CheckTiffIsWhole);
}

void ExpectBad(const Status& status, const std::string& words) {
  ASSERT_FALSE(status) << words;
  EXPECT_EQ(status.error().code, ErrorCode::kBadData);
  EXPECT_THAT(status.error().message, HasSubstr(words));
}

TEST(CheckTiffIsWhole, NeedsTheLastByteOfTheLastTile) {
  const std::string whole = TiledTiff(6);
  EXPECT_TRUE(CheckTiff(whole));
  EXPECT_TRUE(CheckTiff(whole + "something after the picture"));
  ExpectBad(CheckTiff(whole.substr(0, whole.size() - 1)), "has 259 bytes and needs at least 260");
}

TEST(CheckTiffIsWhole, NeedsEveryTileInTheDirectory) {
  ExpectBad(CheckTiff(TiledTiff(4)), "2 tiles of its picture are not in its directory");
}

TEST(CheckTiffIsWhole, LooksIntoSubDirectories) {
  // The first directory holds only the offset of a second one, whose strip ends at byte 300.
  std::string bytes("II*\0", 4);
  Append(bytes, 8, 4);
  bytes += Directory({{330, 13, {64}}}, 8);
  bytes.resize(64);
  bytes += Directory({{273, 4, {200}}, {279, 4, {100}}}, 64);
  bytes.resize(299);
  ExpectBad(CheckTiff(bytes), "has 299 bytes and needs at least 300");
  EXPECT_TRUE(CheckTiff(bytes + 'x'));
}

TEST(CheckTiffIsWhole, ReadsBigEndianFiles) {
  // One directory at 8, one entry: StripOffsets as text of 80 bytes at 100, needed up to 180.
  std::string bytes("MM\0*\0\0\0\x08\0\x01\x01\x11\0\x02\0\0\0\x50\0\0\0\x64\0\0\0\0", 26);
  bytes.resize(179);
  ExpectBad(CheckTiff(bytes), "needs at least 180");
  EXPECT_TRUE(CheckTiff(bytes + 'x'));
}

TEST(CheckTiffIsWhole, EndsOnDirectoriesThatPointAtEachOther) {
  std::string bytes("II*\0", 4);
  Append(bytes, 8, 4);
  std::string directory = Directory({{330, 4, {8}}}, 8);
  directory.resize(directory.size() - 4);
  Append(directory, 8, 4);  // the next directory is this one too
  EXPECT_TRUE(CheckTiff(bytes + directory));
}

Status CheckPng(const std::filesystem::path& path) {
  return InputFile::Open(path).and_then(CheckPngIsWhole);
}

TEST(CheckPngIsWhole, NeedsTheEndMark) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "a.png";
  const std::string signature = "\x89PNG\r\n\x1a\n";
  const std::string text("\0\0\0\x03tEXtabc\x01\x02\x03\x04", 15);
  const std::string end("\0\0\0\0IEND\xAE\x42\x60\x82", 12);
  WriteText(path, signature + text + end + "something after the picture");
  EXPECT_TRUE(CheckPng(path));
  WriteText(path, signature + text);
  ExpectBad(CheckPng(path), "has 23 bytes and needs at least 35");
  WriteText(path, signature + text + end.substr(0, 11));
  ExpectBad(CheckPng(path), "has 34 bytes and needs at least 35");
}

// Every entry of a directory may name the same million values: the cost is bounded by their sum.
TEST(CheckTiffIsWhole, RefusesMoreValuesThanAnyCameraWrites) {
  constexpr uint32_t kEntries = 20;
  std::string bytes("II*\0", 4);
  Append(bytes, 8, 4);
  Append(bytes, kEntries, 2);
  for (uint32_t i = 0; i < kEntries; ++i) {
    Append(bytes, 273, 2);  // strip offsets
    Append(bytes, 4, 2);    // LONG
    Append(bytes, 60000, 4);
    Append(bytes, 300, 4);  // where they stand
  }
  Append(bytes, 0, 4);
  bytes.resize(300 + 4 * 60000);
  ExpectBad(CheckTiff(bytes), "more than 16384 entries or 1048576 values");
}

TEST(CheckTiffIsWhole, RefusesMoreEntriesThanAnyCameraWrites) {
  std::string bytes("II*\0", 4);
  Append(bytes, 8, 4);
  Append(bytes, 20000, 2);
  bytes.resize(10 + 12 * 20000 + 4);
  ExpectBad(CheckTiff(bytes), "more than 16384 entries");
}

TEST(CheckPngIsWhole, RefusesMillionsOfChunks) {
  const TempFolder folder;
  std::string bytes = "\x89PNG\r\n\x1a\n";
  bytes.resize(8 + 12 * ((1 << 20) + 10));
  WriteText(folder.Path() / "a.png", bytes);
  ExpectBad(CheckPng(folder.Path() / "a.png"), "more than 1048576 chunks");
}

TEST(ReadHead, TellsTheStart) {
  const TempFolder folder;
  WriteText(folder.Path() / "a", "0123456789abcdefXYZ");
  EXPECT_EQ(InputFile::Open(folder.Path() / "a").and_then(ReadHead).value(), "0123456789abcdef");
  WriteText(folder.Path() / "b", "");
  const Result<std::string> head = InputFile::Open(folder.Path() / "b").and_then(ReadHead);
  EXPECT_THAT(head.error().message, HasSubstr("b: is empty; copy it again"));
}

}  // namespace
}  // namespace sateen::file_check_test
