#include "imaging/picture_limit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "imaging/image_io.h"
#include "tests/testing/files.h"

namespace sateen::picture_limit_test {
namespace {

using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

std::string ErrorOf(const PictureLimit& limit, ImageSize size, uint64_t bytes) {
  const Status status = limit.Check("a.png", size, bytes);
  if (!status) {
    EXPECT_EQ(status.error().code, ErrorCode::kBadData);
  }
  return status ? "" : status.error().message;
}

TEST(PictureLimit, AllowsPicturesOfUnknownSizeByTheirBytes) {
  const PictureLimit limit;
  EXPECT_EQ(ErrorOf(limit, {6000, 4000}, 2000), "");
  EXPECT_THAT(ErrorOf(limit, {6000, 4001}, 300'000), HasSubstr("at most 24 megapixels"));
  EXPECT_EQ(ErrorOf(limit, {6000, 4001}, 400'000), "");  // 64 pixels per byte
  EXPECT_THAT(ErrorOf(limit, {20000, 20000}, 389'000),
              HasSubstr("a.png: its header says 20000 x 20000 pixels in 389000 bytes; at most 25 "
                        "megapixels are read from it"));
  EXPECT_EQ(ErrorOf(limit, {20000, 20000}, 1'200'000'000), "");
  EXPECT_THAT(ErrorOf(limit, {20001, 20000}, 1'200'000'000), HasSubstr("at most 400 megapixels"));
  EXPECT_THAT(ErrorOf(limit, {20001, 20000}, ~uint64_t{0}), HasSubstr("at most 400 megapixels"));
}

TEST(PictureLimit, AllowsWhatIsAskedFor) {
  const PictureLimit limit{.max_pixels = 100};
  EXPECT_EQ(ErrorOf(limit, {10, 10}, 1), "");
  EXPECT_THAT(ErrorOf(limit, {10, 11}, 10'000), HasSubstr("10 x 11 pixels in 10000 bytes"));
}

TEST(PictureLimit, KnowsTheSizeThatFramesHave) {
  const PictureLimit limit{.size_px = ImageSize{20000, 20000}};
  EXPECT_EQ(ErrorOf(limit, {20000, 20000}, 100'000), "");
  EXPECT_EQ(ErrorOf(limit, {64, 48}, 100'000),
            "a.png: is 64 x 48 px, but the first frame is 20000 x 20000 px; need one size");
  EXPECT_THAT(ErrorOf(limit, {20000, 20000}, 1000), HasSubstr("which 1000 bytes cannot hold"));
}

TEST(PictureLimit, RefusesSizesThatAreNone) {
  EXPECT_THAT(ErrorOf({}, {0, 5}, 100), HasSubstr("0 x 5 pixels; need at least 1 x 1"));
  EXPECT_THAT(ErrorOf({}, {5, -1}, 100), HasSubstr("5 x -1 pixels"));
}

// A grey TGA of 30000 x 30000 pixels in packets of one value for 128 pixels.
TEST(ReadPhoto, RefusesByTheHeaderAlone) {
  const TempFolder folder;
  std::string bytes("\0\0\x0B\0\0\0\0\0\0\0\0\0\x30\x75\x30\x75\x08\0", 18);
  bytes.resize(18 + 500'000, '\xFF');
  WriteText(folder.Path() / "a.tga", bytes);
  const Result<Photo> photo = ReadPhoto(folder.Path() / "a.tga");
  ASSERT_FALSE(photo);
  EXPECT_THAT(photo.error().message, HasSubstr("its header says 30000 x 30000 pixels"));
  const PictureLimit limit{.size_px = ImageSize{64, 48}};
  EXPECT_THAT(ReadPhoto(folder.Path() / "a.tga", Encoding::kAuto, limit).error().message,
              HasSubstr("is 30000 x 30000 px, but the first frame is 64 x 48 px"));
  EXPECT_FALSE(ReadMask(folder.Path() / "a.tga", limit));
  EXPECT_FALSE(ReadImage3(folder.Path() / "a.tga", limit));
  EXPECT_EQ(ReadPhotoSize(folder.Path() / "a.tga", {.max_pixels = 900'000'000}).value(),
            (ImageSize{30000, 30000}));
}

}  // namespace
}  // namespace sateen::picture_limit_test
