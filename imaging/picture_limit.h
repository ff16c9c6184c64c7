#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

/// Bounds a picture by its header, before there is memory for its pixels: some 400 kB of PNG unfold
/// into 5 GB. Where its size is not known beforehand, a picture may have
///
///     max(kSmallPixels, kPixelsPerByte x bytes of the file), at most kMaxPixels                 (1)
///
/// pixels. A photograph has about one pixel per byte; only flat pictures have more than 64.
struct PictureLimit {
  static constexpr int64_t kSmallPixels = 24'000'000;
  static constexpr int64_t kPixelsPerByte = 64;
  static constexpr int64_t kMaxPixels = 400'000'000;

  // Size that the picture must have, as the other frames have it.
  std::optional<ImageSize> size_px = std::nullopt;
  // Pixels that a picture of unknown size may have, in place of (1).
  std::optional<int64_t> max_pixels = std::nullopt;

  // Fails with kBadData where the header's size is refused.
  [[nodiscard]] Status Check(const std::filesystem::path& path, ImageSize header_px,
                             uint64_t file_bytes) const;
};

// Returns the error of a picture whose decoded samples, `bytes`, and planes found no memory.
[[nodiscard]] tl::unexpected<Error> OutOfMemory(const std::filesystem::path& path,
                                                ImageSize size_px, uint64_t bytes);

// Fails with kBadData unless `size` is that of the first frame. `what` opens the message: the file.
[[nodiscard]] Status CheckSize(const std::string& what, ImageSize size, ImageSize frame_size);

}  // namespace sateen
