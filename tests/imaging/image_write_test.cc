#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "imaging/image_io.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"

namespace sateen::image_write_test {
namespace {

using ::testing::HasSubstr;
using testing::ReadBytes;
using testing::SameBits;
using testing::TempFolder;
using testing::TestImage;

TEST(WriteExr, KeepsEveryFloatAndItsPlace) {
  const TempFolder folder;
  Image3 image = TestImage();
  image[0].At(0, 0) = std::numeric_limits<float>::infinity();
  image[1].At(22, 0) = std::numeric_limits<float>::denorm_min();
  image[2].At(0, 16) = -1e30F;
  ASSERT_TRUE(WriteExr(folder.Path() / "normal.exr", image));

  const Result<Image3> back = ReadImage3(folder.Path() / "normal.exr");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_TRUE(SameBits(*back, image));
  const Result<Photo> photo = ReadPhoto(folder.Path() / "normal.exr");
  ASSERT_TRUE(photo) << photo.error().message;
  EXPECT_TRUE(SameBits(photo->rgb, image));
  EXPECT_FALSE(photo->saturation.has_value());
  EXPECT_FALSE(photo->was_srgb);
}

TEST(WriteExr, GivesThreePlanesTheNamesRgbAndDoesNotCompress) {
  const TempFolder folder;
  ASSERT_TRUE(WriteExr(folder.Path() / "normal.exr", TestImage()));
  const auto input = OIIO::ImageInput::open((folder.Path() / "normal.exr").string());
  ASSERT_TRUE(input);
  EXPECT_THAT(input->spec().channelnames, ::testing::ElementsAre("R", "G", "B"));
  EXPECT_EQ(input->spec().format, OIIO::TypeFloat);
  EXPECT_EQ(input->spec().get_string_attribute("compression"), "none");
}

TEST(WriteExr, GivesTheSameBytesAtAnyTime) {
  const TempFolder folder;
  ASSERT_TRUE(WriteExr(folder.Path() / "a.exr", TestImage()));
  const std::string bytes = ReadBytes(folder.Path() / "a.exr");
  // OpenImageIO would put the time of day into capDate, 19 characters like "2024:05:06 07:08:09".
  EXPECT_EQ(bytes.find("capDate"), bytes.find(std::string("capDate\0string\0\0\0\0\0", 19)));
}

TEST(WriteExr, GreyReadsAsThreeEqualPlanes) {
  const TempFolder folder;
  const Image<float> plane = TestImage()[1];
  ASSERT_TRUE(WriteExr(folder.Path() / "residual.exr", plane));
  const Result<Photo> photo = ReadPhoto(folder.Path() / "residual.exr");
  ASSERT_TRUE(photo) << photo.error().message;
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(photo->rgb[c].pixels, plane.pixels);
  }
}

TEST(WritePng8, KeepsThePlanesApartAndInPlace) {
  const TempFolder folder;
  std::array<Image<uint8_t>, 3> image;
  for (size_t c = 0; c < 3; ++c) {
    image[c] = Image<uint8_t>(5, 3);
    for (size_t p = 0; p < 15; ++p) {
      image[c].pixels[p] = static_cast<uint8_t>(p * 10 + c);
    }
  }
  ASSERT_TRUE(WritePng8(folder.Path() / "rgb.png", image));
  const Photo photo = ReadPhoto(folder.Path() / "rgb.png", Encoding::kLinear).value();
  for (size_t c = 0; c < 3; ++c) {
    for (size_t p = 0; p < 15; ++p) {
      EXPECT_EQ(photo.rgb[c].pixels[p], static_cast<float>(p * 10 + c) / 255.0F);
    }
  }
}

TEST(Writers, FailWithTheNameWhereTheFolderIsAbsent) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "absent" / "normal.exr";
  const Status status = WriteExr(path, TestImage());
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr(path.string()));
  EXPECT_THAT(status.error().message, HasSubstr("No such file or directory"));
}

TEST(Writers, NoticeThatTheDiskIsFullAtAnyByte) {
  const TempFolder folder;
  const std::filesystem::path exr = folder.Path() / "a.exr";
  const std::filesystem::path png = folder.Path() / "a.png";
  const std::array<Image<uint16_t>, 3> planes = {Image<uint16_t>(9, 9, 1), Image<uint16_t>(9, 9, 2),
                                                 Image<uint16_t>(9, 9, 3)};
  ASSERT_TRUE(WriteExr(exr, TestImage()));
  ASSERT_TRUE(WritePng16(png, planes));
  const std::uintmax_t exr_bytes = std::filesystem::file_size(exr);
  const std::uintmax_t png_bytes = std::filesystem::file_size(png);
  for (const std::uintmax_t missing : {1U, 2U, 20U, 70U}) {
    const Status exr_status = [&] {
      const testing::FullDisk limit(exr_bytes - missing);
      return WriteExr(exr, TestImage());
    }();
    const Status png_status = [&] {
      const testing::FullDisk limit(png_bytes - missing);
      return WritePng16(png, planes);
    }();
    ASSERT_FALSE(exr_status) << missing;
    ASSERT_FALSE(png_status) << missing;
    EXPECT_EQ(exr_status.error().code, ErrorCode::kIo);
    EXPECT_THAT(exr_status.error().message, HasSubstr(exr.string()));
    EXPECT_THAT(png_status.error().message, HasSubstr("File too large"));
  }
}

}  // namespace
}  // namespace sateen::image_write_test
