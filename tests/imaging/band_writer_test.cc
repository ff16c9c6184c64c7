#include "imaging/band_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "imaging/image_io.h"
#include "tests/imaging/pictures.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"

namespace sateen::band_writer_test {
namespace {

using ::testing::HasSubstr;
using testing::ReadBytes;
using testing::TempFolder;
using testing::TestImage;

template <typename T>
Image<T> RowsOf(const Image<T>& image, int begin, int end) {
  Image<T> rows(image.width, end - begin);
  std::copy_n(image.pixels.begin() + static_cast<std::ptrdiff_t>(image.Index(0, begin)),
              rows.pixels.size(), rows.pixels.begin());
  return rows;
}

template <typename T>
Status WriteInBands(const std::filesystem::path& path, const std::vector<Image<T>>& planes,
                    int band) {
  const ImageSize size = planes[0].Size();
  return BandWriter::Open<T>(path, size, planes.size()).and_then([&](BandWriter writer) {
    Status status;
    for (int begin = 0; status && begin < size.height; begin += band) {
      std::vector<Image<T>> rows;
      for (const Image<T>& plane : planes) {
        rows.push_back(RowsOf(plane, begin, std::min(begin + band, size.height)));
      }
      status = writer.Write(rows);
    }
    return status ? writer.Close() : status;
  });
}

TEST(BandWriter, GivesTheSameBytesHoweverTheImageIsCut) {
  const TempFolder folder;
  const Image3 image = TestImage();
  const std::vector<Image<float>> planes(image.planes.begin(), image.planes.end());
  ASSERT_TRUE(WriteExr(folder.Path() / "whole.exr", image));
  Image<uint16_t> grey(70, 33);
  for (size_t p = 0; p < grey.pixels.size(); ++p) {
    grey.pixels[p] = static_cast<uint16_t>(p * 31);
  }
  ASSERT_TRUE(WriteInBands<uint16_t>(folder.Path() / "whole.png", {grey}, 33));
  for (const int band : {1, 3, 16}) {
    ASSERT_TRUE(WriteInBands(folder.Path() / "bands.exr", planes, band));
    EXPECT_EQ(ReadBytes(folder.Path() / "bands.exr"), ReadBytes(folder.Path() / "whole.exr"));
    ASSERT_TRUE(WriteInBands<uint16_t>(folder.Path() / "bands.png", {grey}, band));
    EXPECT_EQ(ReadBytes(folder.Path() / "bands.png"), ReadBytes(folder.Path() / "whole.png"));
  }
  const Photo back = ReadPhoto(folder.Path() / "bands.png", Encoding::kLinear).value();
  EXPECT_NEAR(back.rgb[0].At(5, 20), static_cast<float>(grey.At(5, 20)) / 65535.0F, 1e-6F);
}

TEST(BandWriter, TellsOfAFolderThatIsNotThere) {
  const Result<BandWriter> writer = BandWriter::Open<float>("/nonexistent/normal.exr", {8, 8}, 1);
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, ErrorCode::kIo);
  EXPECT_THAT(writer.error().message, HasSubstr("No such file"));
}

TEST(BandWriter, TellsOfADiskThatFillsInAnyBand) {
  const TempFolder folder;
  const std::vector<Image<float>> planes = {Image<float>(64, 64, 0.5F)};
  ASSERT_TRUE(WriteInBands(folder.Path() / "a.exr", planes, 8));
  const std::uintmax_t bytes = std::filesystem::file_size(folder.Path() / "a.exr");
  for (const std::uintmax_t room : {bytes / 10, bytes / 2, bytes - 1}) {
    const testing::FullDisk limit(room);
    const Status status = WriteInBands(folder.Path() / "a.exr", planes, 8);
    ASSERT_FALSE(status) << room;
    EXPECT_EQ(status.error().code, ErrorCode::kIo);
    EXPECT_THAT(status.error().message, HasSubstr("File too large"));
  }
}

}  // namespace
}  // namespace sateen::band_writer_test
