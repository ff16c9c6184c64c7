#include "imaging/image_io.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "imaging/color.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"

namespace sateen::image_io_test {
namespace {

using ::testing::HasSubstr;
using testing::SameBits;
using testing::Sample;
using testing::TempFolder;
using testing::TestImage;
using testing::WriteKind;
using testing::WriteText;
using testing::WriteWithOiio;

TEST(ReadPhoto, UndoesSrgbOf8BitFilesOnly) {
  const TempFolder folder;
  Image<uint8_t> codes8(256, 1);
  std::array<Image<uint16_t>, 3> codes16;
  codes16.fill(Image<uint16_t>(256, 1));
  for (int i = 0; i < 256; ++i) {
    codes8.At(i, 0) = static_cast<uint8_t>(i);
    codes16[0].At(i, 0) = static_cast<uint16_t>(i * 257);
    codes16[1].At(i, 0) = static_cast<uint16_t>(i * 256 + 1);
    codes16[2].At(i, 0) = static_cast<uint16_t>(65535 - i);
  }
  ASSERT_TRUE(WritePng8(folder.Path() / "8.png", codes8));
  ASSERT_TRUE(WritePng16(folder.Path() / "16.png", codes16));

  const Photo auto8 = ReadPhoto(folder.Path() / "8.png").value();
  const Photo linear8 = ReadPhoto(folder.Path() / "8.png", Encoding::kLinear).value();
  const Photo auto16 = ReadPhoto(folder.Path() / "16.png").value();
  const Photo srgb16 = ReadPhoto(folder.Path() / "16.png", Encoding::kSrgb).value();

  for (int i = 0; i < 256; ++i) {
    const float code = static_cast<float>(i) / 255.0F;
    EXPECT_EQ(auto8.rgb[2].At(i, 0), LinearFromSrgb(code));
    EXPECT_EQ(linear8.rgb[2].At(i, 0), code);
    for (size_t c = 0; c < 3; ++c) {
      const float value = static_cast<float>(codes16[c].At(i, 0)) / 65535.0F;
      EXPECT_EQ(auto16.rgb[c].At(i, 0), value);
      EXPECT_EQ(srgb16.rgb[c].At(i, 0), LinearFromSrgb(value));
    }
  }
  EXPECT_TRUE(auto8.was_srgb && srgb16.was_srgb);
  EXPECT_FALSE(linear8.was_srgb || auto16.was_srgb);
  EXPECT_EQ(auto8.saturation, 1.0F);
  EXPECT_EQ(auto16.saturation, 1.0F);
  EXPECT_EQ(auto8.rgb[0].At(255, 0), 1.0F);  // saturated samples compare equal to `saturation`
}

TEST(ReadPhoto, TurnsBottomUpTgaTheRightWay) {
  const TempFolder folder;
  // Truevision TGA 2.0: 2 x 2, uncompressed BGR, first row at the bottom (descriptor 0).
  std::string bytes({0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 2, 0, 24, 0});
  bytes += std::string({1, 2, 3, 4, 5, 6}) + std::string({7, 8, 9, 10, 11, 12});
  WriteText(folder.Path() / "a.tga", bytes);
  const Result<Photo> photo = ReadPhoto(folder.Path() / "a.tga", Encoding::kLinear);
  ASSERT_TRUE(photo) << photo.error().message;
  EXPECT_EQ(photo->rgb[0].At(0, 0), 9.0F / 255.0F);
  EXPECT_EQ(photo->rgb[1].At(1, 0), 11.0F / 255.0F);
  EXPECT_EQ(photo->rgb[2].At(1, 1), 4.0F / 255.0F);
}

TEST(ReadPhoto, IgnoresAlpha) {
  const TempFolder folder;
  for (const char* name : {"a.png", "a.tif", "a.tga", "a.exr"}) {
    OIIO::ImageSpec spec(4, 3, 4, std::string(name) == "a.exr" ? OIIO::TypeFloat : OIIO::TypeUInt8);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    std::vector<float> samples;
    for (int p = 0; p < 12; ++p) {
      samples.insert(samples.end(), {0.8F, 0.6F, 0.4F, 0.2F});
    }
    WriteWithOiio(folder.Path() / name, spec, samples);
    const Result<Photo> photo = ReadPhoto(folder.Path() / name, Encoding::kLinear);
    ASSERT_TRUE(photo) << photo.error().message;
    EXPECT_FLOAT_EQ(photo->rgb[0].At(2, 1), 0.8F) << name;  // 204, 153 and 102 of 255
    EXPECT_FLOAT_EQ(photo->rgb[1].At(2, 1), 0.6F) << name;
    EXPECT_FLOAT_EQ(photo->rgb[2].At(2, 1), 0.4F) << name;
  }
}

TEST(ReadPhoto, TakesExrChannelsByNameNotByOrder) {
  const TempFolder folder;
  struct Case {
    std::vector<std::string> names;
    std::vector<float> expected;
  };
  const std::vector<float> samples = {0.1F, 0.2F, 0.3F, 0.4F};
  for (const Case& c :
       {Case{{"B", "G", "R"}, {0.3F, 0.2F, 0.1F}}, Case{{"A", "X", "Y", "Z"}, {0.2F, 0.3F, 0.4F}},
        Case{{"Y", "A"}, {0.1F, 0.1F, 0.1F}}}) {
    const int count = static_cast<int>(c.names.size());
    OIIO::ImageSpec spec(1, 1, count, OIIO::TypeFloat);
    spec.channelnames = c.names;
    WriteWithOiio(folder.Path() / "c.exr", spec, {samples.begin(), samples.begin() + count});
    const Result<Photo> photo = ReadPhoto(folder.Path() / "c.exr");
    ASSERT_TRUE(photo) << photo.error().message;
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(photo->rgb[k].At(0, 0), c.expected[k]) << c.names[0] << ' ' << k;
    }
  }
}

TEST(ReadPhoto, ReadsHalfDoubleAndJpeg) {
  const TempFolder folder;
  WriteKind(folder.Path() / "half.exr", {"", OIIO::TypeHalf});
  WriteKind(folder.Path() / "double.tif", {"", OIIO::TypeDesc::DOUBLE});
  const Photo half = ReadPhoto(folder.Path() / "half.exr").value();
  const Photo twice = ReadPhoto(folder.Path() / "double.tif").value();
  EXPECT_NEAR(half.rgb[1].At(40, 30), Sample(40, 30, 1), 3e-4);  // a half has 11 bits
  EXPECT_EQ(twice.rgb[1].At(40, 30), Sample(40, 30, 1));

  OIIO::ImageSpec spec(16, 16, 3, OIIO::TypeUInt8);
  spec.attribute("compression", "jpeg:100");
  WriteWithOiio(folder.Path() / "grey.jpg", spec, std::vector<float>(16 * 16 * 3, 100.0F / 255.0F));
  const Photo jpeg = ReadPhoto(folder.Path() / "grey.jpg").value();
  // A constant survives JPEG but for the rounding of its one coefficient: one code.
  EXPECT_NEAR(SrgbFromLinear(jpeg.rgb[0].At(7, 7)) * 255.0F, 100.0F, 1.01F);
  EXPECT_TRUE(jpeg.was_srgb);
}

TEST(ReadPhoto, KnowsTheFormatByContentNotByName) {
  const TempFolder folder;
  ASSERT_TRUE(WriteExr(folder.Path() / "a.png", TestImage()));
  const Result<Photo> photo = ReadPhoto(folder.Path() / "a.png");
  ASSERT_TRUE(photo) << photo.error().message;
  EXPECT_TRUE(SameBits(photo->rgb, TestImage()));
}

TEST(ReadPhoto, RefusesChannelCountsAndTypesItDoesNotKnow) {
  const TempFolder folder;
  WriteKind(folder.Path() / "five.exr", {"", OIIO::TypeFloat, 5});
  const Result<Photo> five = ReadPhoto(folder.Path() / "five.exr");
  ASSERT_FALSE(five);
  EXPECT_EQ(five.error().code, ErrorCode::kBadData);
  EXPECT_THAT(five.error().message, HasSubstr("has 5 channels; needed are 1 to 4"));

  WriteKind(folder.Path() / "ids.exr", {"", OIIO::TypeUInt32});
  const Result<Photo> ids = ReadPhoto(folder.Path() / "ids.exr");
  ASSERT_FALSE(ids);
  EXPECT_EQ(ids.error().code, ErrorCode::kBadData);
  EXPECT_THAT(ids.error().message, HasSubstr("has uint samples; needed are 8 or 16-bit"));
}

TEST(ReadPhoto, RefusesACroppedExr) {
  const TempFolder folder;
  OIIO::ImageSpec spec(4, 3, 3, OIIO::TypeFloat);
  spec.x = 1;
  spec.full_width = 10;
  WriteWithOiio(folder.Path() / "crop.exr", spec, std::vector<float>(36, 0.5F));
  const Result<Photo> photo = ReadPhoto(folder.Path() / "crop.exr");
  ASSERT_FALSE(photo);
  EXPECT_EQ(photo.error().code, ErrorCode::kBadData);
  EXPECT_THAT(photo.error().message,
              HasSubstr("data window 4x3+1+0 is not its display window 10x3+0+0"));
}

TEST(ReadImage3, NeedsThreeChannels) {
  const TempFolder folder;
  ASSERT_TRUE(WriteExr(folder.Path() / "grey.exr", TestImage()[0]));
  const Result<Image3> image = ReadImage3(folder.Path() / "grey.exr");
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, ErrorCode::kBadData);
  EXPECT_THAT(image.error().message, HasSubstr("grey.exr: has 1 channel(s); needed are three"));
}

TEST(ReadImage3, DoesNotUndoSrgb) {
  const TempFolder folder;
  std::array<Image<uint8_t>, 3> grey;
  grey.fill(Image<uint8_t>(2, 2, 128));
  ASSERT_TRUE(WritePng8(folder.Path() / "normal.png", grey));
  EXPECT_EQ(ReadImage3(folder.Path() / "normal.png").value()[0].At(1, 1), 128.0F / 255.0F);
}

TEST(ReadMask, IsInsideFromHalfOfFullScaleOnInAnyChannel) {
  const TempFolder folder;
  Image<uint8_t> grey(4, 1);
  grey.pixels = {0, 127, 128, 255};
  ASSERT_TRUE(WritePng8(folder.Path() / "grey.png", grey));
  EXPECT_THAT(ReadMask(folder.Path() / "grey.png").value().pixels,
              ::testing::ElementsAre(0, 0, 255, 255));

  std::array<Image<uint16_t>, 3> colour;
  colour.fill(Image<uint16_t>(3, 1));
  colour[0].At(0, 0) = 32767;
  colour[1].At(1, 0) = 32768;
  colour[2].At(2, 0) = 65535;
  ASSERT_TRUE(WritePng16(folder.Path() / "colour.png", colour));
  EXPECT_THAT(ReadMask(folder.Path() / "colour.png").value().pixels,
              ::testing::ElementsAre(0, 255, 255));
}

TEST(IsPhotoName, GoesByTheEndingInAnyCase) {
  for (const char* name : {"a.exr", "b/c.PNG", "a.tif", "a.TIFF", "a.tga", "a.JPG", "a.jpeg"}) {
    EXPECT_TRUE(IsPhotoName(name)) << name;
  }
  for (const char* name : {"a.nef", "png", "a.png.txt", "lights.txt", ".png"}) {
    EXPECT_FALSE(IsPhotoName(name)) << name;
  }
}

TEST(ReadImage3, ReadsThePublishedNormalsOfDiligent) {
  SATEEN_NEEDS_DATA("diligent-ball");
  const std::filesystem::path folder = testing::DataDir() / "diligent-ball";
  const Result<Image3> normal = ReadImage3(folder / "normal_gt.exr");
  ASSERT_TRUE(normal) << normal.error().message;
  const Result<Mask> mask = ReadMask(folder / "mask.png");
  ASSERT_TRUE(mask) << mask.error().message;
  ASSERT_EQ(normal->Size(), (ImageSize{612, 512}));
  ASSERT_EQ(mask->Size(), normal->Size());
  int inside = 0;
  for (size_t p = 0; p < mask->pixels.size(); ++p) {
    if (mask->pixels[p] == 255) {
      ++inside;
      const Image3& n = *normal;
      ASSERT_NEAR(std::hypot(n[0].pixels[p], n[1].pixels[p], n[2].pixels[p]), 1.0F, 1e-5F);
    }
  }
  EXPECT_EQ(inside, 15791);  // the data set's own count
}

TEST(ReadPhoto, ReadsEveryPictureOfTheRealData) {
  SATEEN_NEEDS_DATA("uw-psm");
  int pictures = 0;
  for (const char* name : {"uw-psm", "harvard-psd/cat", "leaf-scanner", "lens/opencv-left"}) {
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(testing::DataDir() / name)) {
      if (entry.is_regular_file() && IsPhotoName(entry.path())) {
        const Result<Photo> photo = ReadPhoto(entry.path());
        ASSERT_TRUE(photo) << photo.error().message;
        ++pictures;
      }
    }
  }
  EXPECT_GT(pictures, 100);
}

}  // namespace
}  // namespace sateen::image_io_test
