#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <exception>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/check.h"
#include "imaging/band_writer.h"
#include "imaging/image_io.h"

namespace sateen {
namespace {

template <typename T>
Status Write(const std::filesystem::path& path, std::span<const Image<T>> planes) {
  return BandWriter::Open<T>(path, planes[0].Size(), planes.size())
      .and_then([&](BandWriter writer) {
        return writer.Write(planes).and_then([&] { return writer.Close(); });
      });
}

}  // namespace

Status WriteExr(const std::filesystem::path& path, const Image3& image) {
  return Write<float>(path, image.planes);
}

Status WriteExr(const std::filesystem::path& path, const Image<float>& image) {
  return Write<float>(path, {&image, 1});
}

Status WritePng8(const std::filesystem::path& path, const Image<uint8_t>& image) {
  return Write<uint8_t>(path, {&image, 1});
}

Status WritePng8(const std::filesystem::path& path, const std::array<Image<uint8_t>, 3>& image) {
  return Write<uint8_t>(path, image);
}

Status WritePng16(const std::filesystem::path& path, const std::array<Image<uint16_t>, 3>& image) {
  return Write<uint16_t>(path, image);
}

Result<std::string> EncodeJpeg(const std::array<Image<uint8_t>, 3>& image) {
  const ImageSize size = image[0].Size();
  SATEEN_CHECK(size.width > 0 && size.height > 0);
  std::vector<uint8_t> samples(size.PixelCount() * 3);
  for (size_t p = 0; p < samples.size(); ++p) {
    samples[p] = image[p % 3].pixels[p / 3];
  }
  OIIO::ImageSpec spec(size.width, size.height, 3, OIIO::TypeDesc::UINT8);
  spec.attribute("Compression", "jpeg:90");
  try {
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create("jpeg");
    if (!output) {
      return Fail(ErrorCode::kIo, "this OpenImageIO cannot write JPEG: {}", OIIO::geterror());
    }
    output->set_ioproxy(&memory);
    if (!output->open("preview.jpg", spec) || !output->write_image(spec.format, samples.data()) ||
        !output->close()) {
      return Fail(ErrorCode::kIo, "preview.jpg: cannot be encoded: {}", output->geterror());
    }
    return std::string(bytes.begin(), bytes.end());
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "preview.jpg: cannot be encoded: {}", error.what());
  }
}

}  // namespace sateen
