#include "imaging/band_writer.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fcntl.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/check.h"

namespace sateen {
namespace {

// Rows as differences from the row above, runs and Huffman codes: as small as zlib's level 1 with
// libpng's choice of filters on normals, whose last bits are noise, in a third of the time.
constexpr const char* kPngStrategy = "rle";
constexpr size_t kBytesOnTheirWay = size_t{8} << 20;
constexpr int kPngFilterUp = 0x20;

// A file that loses no errors: OpenImageIO does not tell when its last buffer fails to reach the
// disk.
class CheckedFile final : public OIIO::Filesystem::IOProxy {
 public:
  explicit CheckedFile(const std::string& path)
      : IOProxy(path, Write), file_(std::fopen(path.c_str(), "wb+")) {
    Note(file_ != nullptr);
  }
  CheckedFile(const CheckedFile&) = delete;
  CheckedFile& operator=(const CheckedFile&) = delete;
  ~CheckedFile() override { Finish(); }

  [[nodiscard]] const char* proxytype() const override { return "sateen"; }
  bool seek(int64_t offset) override {
    m_pos = offset;
    return Note(file_ != nullptr && fseeko(file_, offset, SEEK_SET) == 0);
  }
  size_t write(const void* bytes, size_t count) override {
    const size_t written = file_ == nullptr ? 0 : std::fwrite(bytes, 1, count, file_);
    Note(written == count);
    m_pos += static_cast<int64_t>(written);
    size_ = std::max(size_, static_cast<size_t>(m_pos));
    if (size_ - on_its_way_ >= kBytesOnTheirWay) {
      // So that whoever flushes the file to the disk at the end finds most of it there.
      static_cast<void>(sync_file_range(fileno(file_), static_cast<off_t>(on_its_way_), 0,
                                        SYNC_FILE_RANGE_WRITE));
      on_its_way_ = size_;
    }
    return written;
  }
  [[nodiscard]] size_t size() const override { return size_; }
  void flush() const override {}
  // Returns the first error of all, 0 for none; the file is closed.
  int Finish() {
    if (file_ != nullptr) {
      Note(std::fclose(std::exchange(file_, nullptr)) == 0);
    }
    return error_;
  }

 private:
  bool Note(bool is_good) {
    if (!is_good && error_ == 0) {
      error_ = errno != 0 ? errno : EIO;
    }
    return is_good;
  }

  std::FILE* file_;
  size_t size_ = 0;
  size_t on_its_way_ = 0;  // bytes that the system was told to write
  int error_ = 0;
};

}  // namespace

struct BandWriter::Impl {
  std::string path;
  OIIO::ImageSpec spec;
  int next_row = 0;
  CheckedFile file;
  std::unique_ptr<OIIO::ImageOutput> output;
  std::vector<char> samples;  // samples of a band, interleaved

  Impl(std::string file_path, OIIO::ImageSpec file_spec)
      : path(std::move(file_path)), spec(std::move(file_spec)), file(path) {}

  [[nodiscard]] Status Cannot(const std::string& why) {
    const int error = file.Finish();
    return Fail(ErrorCode::kIo, "{}: cannot be written whole: {}", path,
                error != 0 ? std::generic_category().message(error) : why);
  }

  template <typename T>
  Status WriteRows(std::span<const Image<T>> planes) {
    const ImageSize size = planes[0].Size();
    SATEEN_CHECK(planes.size() == static_cast<size_t>(spec.nchannels) && size.width == spec.width &&
                 next_row + size.height <= spec.height &&
                 spec.format == OIIO::TypeDesc(OIIO::BaseTypeFromC<T>::value));
    samples.resize(size.PixelCount() * planes.size() * sizeof(T));
    T* const to = reinterpret_cast<T*>(samples.data());
    for (size_t c = 0; c < planes.size(); ++c) {
      SATEEN_CHECK(planes[c].Size() == size);
      for (size_t p = 0; p < size.PixelCount(); ++p) {
        to[p * planes.size() + c] = planes[c].pixels[p];
      }
    }
    try {
      if (!output->write_scanlines(next_row, next_row + size.height, 0, spec.format, to)) {
        return Cannot(output->geterror());
      }
    } catch (const std::exception& error) {
      return Cannot(error.what());
    }
    next_row += size.height;
    return {};
  }
};

BandWriter::BandWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BandWriter::BandWriter(BandWriter&& other) noexcept = default;
BandWriter& BandWriter::operator=(BandWriter&& other) noexcept = default;
BandWriter::~BandWriter() = default;

template <typename T>
Result<BandWriter> BandWriter::Open(const std::filesystem::path& path, ImageSize size,
                                    size_t channels, std::optional<double> pixel_mm) {
  SATEEN_CHECK(size.width > 0 && size.height > 0 && (channels == 1 || channels == 3));
  OIIO::ImageSpec spec(size.width, size.height, static_cast<int>(channels),
                       OIIO::BaseTypeFromC<T>::value);
  const bool is_exr = std::is_same_v<T, float>;
  spec.attribute("Compression", is_exr ? "none" : kPngStrategy);
  spec.attribute("png:filter", kPngFilterUp);
  if (pixel_mm) {
    const auto per_metre = static_cast<float>(std::round(1000.0 / *pixel_mm));
    spec.attribute("XResolution", per_metre);
    spec.attribute("YResolution", per_metre);
    spec.attribute("ResolutionUnit", "m");
  }
  spec.attribute("DateTime", "");  // otherwise EXR gets the time of day, and no two files agree
  try {
    auto impl = std::make_unique<Impl>(path.string(), std::move(spec));
    impl->output = OIIO::ImageOutput::create(is_exr ? "openexr" : "png");
    if (!impl->output) {
      return tl::unexpected(impl->Cannot(OIIO::geterror()).error());
    }
    impl->output->set_ioproxy(&impl->file);
    if (!impl->output->open(impl->path, impl->spec)) {
      return tl::unexpected(impl->Cannot(impl->output->geterror()).error());
    }
    return BandWriter(std::move(impl));
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kIo, "{}: cannot be encoded: {}", path.string(), error.what());
  }
}

template Result<BandWriter> BandWriter::Open<float>(const std::filesystem::path&, ImageSize, size_t,
                                                    std::optional<double>);
template Result<BandWriter> BandWriter::Open<uint8_t>(const std::filesystem::path&, ImageSize,
                                                      size_t, std::optional<double>);
template Result<BandWriter> BandWriter::Open<uint16_t>(const std::filesystem::path&, ImageSize,
                                                       size_t, std::optional<double>);

Status BandWriter::Write(std::span<const Image<float>> planes) { return impl_->WriteRows(planes); }
Status BandWriter::Write(std::span<const Image<uint8_t>> planes) {
  return impl_->WriteRows(planes);
}
Status BandWriter::Write(std::span<const Image<uint16_t>> planes) {
  return impl_->WriteRows(planes);
}

Status BandWriter::Close() {
  SATEEN_CHECK(impl_->next_row == impl_->spec.height);
  try {
    if (!impl_->output->close()) {
      return impl_->Cannot(impl_->output->geterror());
    }
  } catch (const std::exception& error) {
    return impl_->Cannot(error.what());
  }
  return impl_->file.Finish() == 0 ? Status() : impl_->Cannot("");
}

}  // namespace sateen
