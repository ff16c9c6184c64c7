#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cerrno>
#include <exception>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "core/check.h"
#include "imaging/image_io.h"

namespace sateen {
namespace {

template <typename T>
Result<std::vector<unsigned char>> Encode(const std::filesystem::path& path, const char* format,
                                          std::span<const Image<T>> planes) {
  const ImageSize size = planes[0].Size();
  const size_t channels = planes.size();
  SATEEN_CHECK(size.width > 0 && size.height > 0);
  std::vector<T> samples(size.PixelCount() * channels);
  for (size_t c = 0; c < channels; ++c) {
    SATEEN_CHECK(planes[c].Size() == size);
    for (size_t p = 0; p < size.PixelCount(); ++p) {
      samples[p * channels + c] = planes[c].pixels[p];
    }
  }
  OIIO::ImageSpec spec(size.width, size.height, static_cast<int>(channels),
                       OIIO::BaseTypeFromC<T>::value);
  spec.attribute("Compression", "jpeg:90");  // of the formats that know it
  spec.attribute("DateTime", "");  // otherwise EXR gets the time of day, and no two files agree

  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(format);
  if (!output) {
    return Fail(ErrorCode::kIo, "{}: this OpenImageIO cannot write {} files: {}", path.string(),
                format, OIIO::geterror());
  }
  output->set_ioproxy(&memory);
  if (!output->open(path.string(), spec) || !output->write_image(spec.format, samples.data()) ||
      !output->close()) {
    return Fail(ErrorCode::kIo, "{}: cannot be encoded: {}", path.string(), output->geterror());
  }
  return bytes;
}

// Encoded in memory and written here, because OpenImageIO does not tell when the last buffer of
// a file fails to reach the disk.
template <typename T>
Status Write(const std::filesystem::path& path, const char* format,
             std::span<const Image<T>> planes) {
  try {
    const Result<std::vector<unsigned char>> bytes = Encode(path, format, planes);
    if (!bytes) {
      return tl::unexpected(bytes.error());
    }
    errno = 0;
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes->data()),
               static_cast<std::streamsize>(bytes->size()));
    file.close();
    if (!file) {
      return Fail(ErrorCode::kIo, "{}: cannot be written whole ({} bytes): {}", path.string(),
                  bytes->size(), std::generic_category().message(errno));
    }
    return {};
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "{}: cannot be encoded: {}", path.string(), error.what());
  }
}

}  // namespace

Status WriteExr(const std::filesystem::path& path, const Image3& image) {
  return Write<float>(path, "openexr", image.planes);
}

Status WriteExr(const std::filesystem::path& path, const Image<float>& image) {
  return Write<float>(path, "openexr", {&image, 1});
}

Status WritePng8(const std::filesystem::path& path, const Image<uint8_t>& image) {
  return Write<uint8_t>(path, "png", {&image, 1});
}

Status WritePng8(const std::filesystem::path& path, const std::array<Image<uint8_t>, 3>& image) {
  return Write<uint8_t>(path, "png", image);
}

Status WritePng16(const std::filesystem::path& path, const std::array<Image<uint16_t>, 3>& image) {
  return Write<uint16_t>(path, "png", image);
}

Result<std::string> EncodeJpeg(const std::array<Image<uint8_t>, 3>& image) {
  try {
    return Encode<uint8_t>("preview.jpg", "jpeg", image)
        .map([](const std::vector<unsigned char>& bytes) {
          return std::string(bytes.begin(), bytes.end());
        });
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "preview.jpg: cannot be encoded: {}", error.what());
  }
}

}  // namespace sateen
