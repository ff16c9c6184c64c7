#include "imaging/image_io.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "imaging/color.h"
#include "tests/testing/files.h"

namespace sateen {
namespace {

using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

// A picture that no coder packs to nothing, different in every channel.
float Sample(int x, int y, int channel) {
  return 0.5F + 0.45F * std::sin(0.13F * static_cast<float>(x * (channel + 1)) +
                                 0.21F * static_cast<float>(y) * static_cast<float>(x % 7));
}

struct FileKind {
  const char* name;
  OIIO::TypeDesc type;
  int channels = 3;
  const char* compression = nullptr;
  int tile_px = 0;
};

// Writes with OpenImageIO itself, for the kinds of file that our own writers do not make.
void WriteWithOiio(const std::filesystem::path& path, OIIO::ImageSpec spec,
                   const std::vector<float>& samples) {
  const auto output = OIIO::ImageOutput::create(path.string());
  ASSERT_TRUE(output) << OIIO::geterror();
  ASSERT_TRUE(output->open(path.string(), spec)) << output->geterror();
  ASSERT_TRUE(output->write_image(OIIO::TypeFloat, samples.data())) << output->geterror();
  ASSERT_TRUE(output->close()) << output->geterror();
}

void WriteKind(const std::filesystem::path& path, const FileKind& kind) {
  OIIO::ImageSpec spec(97, 61, kind.channels, kind.type);
  spec.tile_width = spec.tile_height = kind.tile_px;
  if (kind.compression != nullptr) {
    spec.attribute("compression", kind.compression);
  }
  std::vector<float> samples;
  for (int y = 0; y < spec.height; ++y) {
    for (int x = 0; x < spec.width; ++x) {
      for (int c = 0; c < kind.channels; ++c) {
        samples.push_back(Sample(x, y, c));
      }
    }
  }
  WriteWithOiio(path, spec, samples);
}

std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

bool SameBits(const Image3& a, const Image3& b) {
  return a.Size() == b.Size() && a[0].pixels == b[0].pixels && a[1].pixels == b[1].pixels &&
         a[2].pixels == b[2].pixels;
}

Image3 TestImage() {
  Image3 image(ImageSize{23, 17});
  for (size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 23; ++x) {
        image[c].At(x, y) = Sample(x, y, static_cast<int>(c)) * 2.0F - 1.0F;
      }
    }
  }
  return image;
}

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

TEST(WriteExr, GivesThreePlanesTheNamesRgbAndZip) {
  const TempFolder folder;
  ASSERT_TRUE(WriteExr(folder.Path() / "normal.exr", TestImage()));
  const auto input = OIIO::ImageInput::open((folder.Path() / "normal.exr").string());
  ASSERT_TRUE(input);
  EXPECT_THAT(input->spec().channelnames, ::testing::ElementsAre("R", "G", "B"));
  EXPECT_EQ(input->spec().format, OIIO::TypeFloat);
  EXPECT_EQ(input->spec().get_string_attribute("compression"), "zip");
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
      kept -= near_an_end ? 1 : std::min<std::uintmax_t>(kept, 1 + whole / 97);
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
    for (std::uintmax_t kept = whole_bytes - 1; kept > 0;
         kept -= std::min<std::uintmax_t>(kept, 41)) {
      testing::CutShort(path, kept);
      const Result<Photo> photo = ReadPhoto(path);
      (photo ? complete : refused) += 1;
      // TGA has no end mark, only an optional footer (521 bytes here) after the pixels.
      ASSERT_TRUE(!photo || (whole_bytes - kept < 530 && SameBits(photo->rgb, whole.rgb))) << kept;
    }
    EXPECT_GT(complete, 5);
    EXPECT_GT(refused, 100);
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

TEST(Writers, FailWithTheNameWhereTheFolderIsAbsent) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "absent" / "normal.exr";
  const Status status = WriteExr(path, TestImage());
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr(path.string()));
  EXPECT_THAT(status.error().message, HasSubstr("No such file or directory"));
}

// Lets files grow to `bytes` only while it lives, as a full disk would.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    signal_before_ = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_before_);
  }

 private:
  rlimit before_ = {};
  void (*signal_before_)(int) = nullptr;
};

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
      const FileSizeLimit limit(exr_bytes - missing);
      return WriteExr(exr, TestImage());
    }();
    const Status png_status = [&] {
      const FileSizeLimit limit(png_bytes - missing);
      return WritePng16(png, planes);
    }();
    ASSERT_FALSE(exr_status) << missing;
    ASSERT_FALSE(png_status) << missing;
    EXPECT_EQ(exr_status.error().code, ErrorCode::kIo);
    EXPECT_THAT(exr_status.error().message, HasSubstr(exr.string()));
    EXPECT_THAT(png_status.error().message, HasSubstr("File too large"));
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
}  // namespace sateen
