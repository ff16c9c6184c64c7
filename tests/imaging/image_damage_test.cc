#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "imaging/image_io.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"

namespace sateen::image_damage_test {
namespace {

using testing::FileKind;
using ::testing::HasSubstr;
using testing::ReadBytes;
using testing::SameBits;
using testing::TempFolder;
using testing::WriteKind;
using testing::WriteText;

TEST(ReadPhoto, RefusesFilesCutShortAtAnyLength) {
  const FileKind kinds[] = {
      {"none.exr", OIIO::TypeFloat, 3, "none"},
      {"zip.exr", OIIO::TypeFloat, 3, "zip"},
      {"piz.exr", OIIO::TypeHalf, 3, "piz"},
      {"tiled.exr", OIIO::TypeFloat, 3, "zip", 16},
      {"8.png", OIIO::TypeUInt8},
      {"16.png", OIIO::TypeUInt16},
      {"grey.png", OIIO::TypeUInt8, 1},
      {"none.tif", OIIO::TypeUInt16, 3, "none"},
      {"zip.tif", OIIO::TypeUInt8, 3, "zip"},
      {"lzw.tif", OIIO::TypeUInt8, 3, "lzw"},
      {"float.tif", OIIO::TypeFloat, 3, "none"},
      {"tiled.tif", OIIO::TypeUInt8, 3, "zip", 16},
      {"rgb.jpg", OIIO::TypeUInt8},
      {"grey.jpg", OIIO::TypeUInt8, 1},
  };
  for (const FileKind& kind : kinds) {
    const TempFolder folder;
    const std::filesystem::path path = folder.Path() / kind.name;
    WriteKind(path, kind);
    ASSERT_TRUE(ReadPhoto(path)) << kind.name;
    const std::uintmax_t whole = std::filesystem::file_size(path);
    // From the end down: every length near the end and near the start, samples between.
    std::uintmax_t kept = whole;
    while (kept > 0) {
      const bool near_an_end = kept < 40 || whole - kept < 40;
      kept -= near_an_end ? 1 : std::min<std::uintmax_t>(kept, 1 + whole / 47);
      testing::CutShort(path, kept);
      const Result<Photo> photo = ReadPhoto(path);
      ASSERT_FALSE(photo) << kind.name << " cut to " << kept << " of " << whole;
      ASSERT_EQ(photo.error().code, ErrorCode::kBadData);
      ASSERT_THAT(photo.error().message, HasSubstr(path.string()));
    }
  }
}

TEST(ReadPhoto, TgaCutShortFailsOrHasAllItsPixels) {
  for (const char* compression : {"none", "rle"}) {
    const TempFolder folder;
    const std::filesystem::path path = folder.Path() / "a.tga";
    WriteKind(path, {"", OIIO::TypeUInt8, 3, compression});
    const Photo whole = ReadPhoto(path).value();
    const std::uintmax_t whole_bytes = std::filesystem::file_size(path);
    int refused = 0;
    int complete = 0;
    for (std::uintmax_t kept = whole_bytes - 1; kept > 200;
         kept -= whole_bytes - kept < 600 ? 41 : 199) {
      testing::CutShort(path, kept);
      const Result<Photo> photo = ReadPhoto(path);
      (photo ? complete : refused) += 1;
      // TGA has no end mark, only an optional footer (521 bytes here) after the pixels.
      ASSERT_TRUE(!photo || (whole_bytes - kept < 530 && SameBits(photo->rgb, whole.rgb))) << kept;
    }
    EXPECT_GT(complete, 5);
    EXPECT_GT(refused, 50);
  }
}

TEST(ReadPhoto, TellsAbsentFromUnreadableFromBad) {
  const TempFolder folder;
  const Result<Photo> absent = ReadPhoto(folder.Path() / "absent.png");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::kIo);
  EXPECT_THAT(absent.error().message, HasSubstr("absent.png: no such file"));
  const Result<Photo> folder_itself = ReadPhoto(folder.Path());
  ASSERT_FALSE(folder_itself);
  EXPECT_EQ(folder_itself.error().code, ErrorCode::kIo);

  WriteText(folder.Path() / "empty.png", "");
  WriteText(folder.Path() / "text.png", "this is not a picture, whatever its name says");
  WriteText(folder.Path() / "text.tga", "this is not a picture, whatever its name says");
  for (const char* name : {"empty.png", "text.png", "text.tga"}) {
    const Result<Photo> photo = ReadPhoto(folder.Path() / name);
    ASSERT_FALSE(photo) << name;
    EXPECT_EQ(photo.error().code, ErrorCode::kBadData);
    EXPECT_THAT(photo.error().message, HasSubstr(name));
  }
}

// Puts `value` over the number of `width` bytes at `offset`.
void Patch(std::string& bytes, size_t offset, uint32_t value, size_t width, bool big_endian) {
  for (size_t i = 0; i < width; ++i) {
    bytes[offset + (big_endian ? width - 1 - i : i)] = static_cast<char>(value >> (8 * i) & 0xFF);
  }
}

TEST(ReadPhoto, RefusesHeadersThatTheFileCannotHold) {
  const TempFolder folder;
  for (const uint32_t side : {0U, 40000U, 65535U, 2000000000U}) {
    for (const char* name : {"a.exr", "a.tga", "a.png", "a.jpg"}) {
      const std::filesystem::path path = folder.Path() / name;
      WriteKind(path, {"", path.extension() == ".exr" ? OIIO::TypeFloat : OIIO::TypeUInt8});
      std::string bytes = ReadBytes(path);
      if (path.extension() == ".exr") {
        for (const char* window : {"dataWindow", "displayWindow"}) {
          // name 0 "box2i" 0 size(4) xMin yMin xMax yMax
          const size_t box = bytes.find(window) + std::string(window).size() + 1 + 6 + 4;
          Patch(bytes, box + 8, side - 1, 4, false);
          Patch(bytes, box + 12, side - 1, 4, false);
        }
      } else if (path.extension() == ".tga") {
        Patch(bytes, 12, std::min(side, 65535U), 2, false);
        Patch(bytes, 14, std::min(side, 65535U), 2, false);
      } else if (path.extension() == ".jpg") {
        const size_t frame = bytes.find("\xFF\xC0");  // marker, length, precision, height, width
        Patch(bytes, frame + 5, std::min(side, 65500U), 2, true);
        Patch(bytes, frame + 7, std::min(side, 65500U), 2, true);
      } else {
        Patch(bytes, 16, side, 4, true);  // IHDR; its checksum goes wrong too
        Patch(bytes, 20, side, 4, true);
      }
      WriteText(path, bytes);
      const Result<Photo> photo = ReadPhoto(path);
      ASSERT_FALSE(photo) << name << ' ' << side;
      EXPECT_EQ(photo.error().code, ErrorCode::kBadData);
      EXPECT_THAT(photo.error().message, HasSubstr(name));
    }
  }
}

TEST(ReadPhoto, RefusesMorePixelsThanAPhotographOfItsBytesHas) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "a.tga";
  WriteKind(path, {"", OIIO::TypeUInt8});
  std::string bytes = ReadBytes(path).substr(0, 18);
  Patch(bytes, 12, 65535, 2, false);
  Patch(bytes, 14, 65535, 2, false);
  bytes.resize(2'000'000);  // long enough that a run-length coder might have done it
  WriteText(path, bytes);
  const Result<Photo> photo = ReadPhoto(path);
  ASSERT_FALSE(photo);
  EXPECT_EQ(photo.error().code, ErrorCode::kBadData);
  EXPECT_THAT(photo.error().message,
              HasSubstr("65535 x 65535 pixels in 2000000 bytes; at most 128 megapixels"));
}

}  // namespace
}  // namespace sateen::image_damage_test
