#include "imaging/picture_limit.h"

#include <algorithm>

#include "imaging/file_check.h"

namespace sateen {

Status PictureLimit::Check(const std::filesystem::path& path, ImageSize header_px,
                           uint64_t file_bytes) const {
  const int64_t pixels = int64_t{header_px.width} * header_px.height;
  if (header_px.width <= 0 || header_px.height <= 0) {
    return Fail(ErrorCode::kBadData, "{}: its header says {} x {} pixels; need at least 1 x 1",
                path.string(), header_px.width, header_px.height);
  }
  if (static_cast<uint64_t>(pixels) / kMaxCompression > file_bytes) {
    return Fail(ErrorCode::kBadData,
                "{}: its header says {} x {} pixels, which {} bytes cannot hold; the file is "
                "damaged or cut short",
                path.string(), header_px.width, header_px.height, file_bytes);
  }
  if (size_px) {
    return CheckSize(path.string(), header_px, *size_px);
  }
  const auto per_bytes =
      static_cast<int64_t>(std::min<uint64_t>(file_bytes, kMaxPixels / kPixelsPerByte)) *
      kPixelsPerByte;
  const int64_t most = max_pixels.value_or(std::max(kSmallPixels, per_bytes));  // (1)
  if (pixels > most) {
    return Fail(ErrorCode::kBadData,
                "{}: its header says {} x {} pixels in {} bytes; at most {:.0f} megapixels are "
                "read from it: if it is right, save it uncompressed; sateen solve also takes "
                "--max-megapixels",
                path.string(), header_px.width, header_px.height, file_bytes,
                1e-6 * static_cast<double>(most));
  }
  return {};
}

tl::unexpected<Error> OutOfMemory(const std::filesystem::path& path, ImageSize size_px,
                                  uint64_t bytes) {
  const uint64_t planes = 3 * sizeof(float) * size_px.PixelCount();
  return Fail(ErrorCode::kOutOfMemory,
              "{}: out of memory: its {} x {} pixels need {} MB; read fewer frames at a time with "
              "--threads 1, or use a machine with more memory",
              path.string(), size_px.width, size_px.height, (bytes + planes) / 1'000'000);
}

Status CheckSize(const std::string& what, ImageSize size, ImageSize frame_size) {
  if (size == frame_size) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{}: is {} x {} px, but the first frame is {} x {} px; need one size", what,
              size.width, size.height, frame_size.width, frame_size.height);
}

}  // namespace sateen
