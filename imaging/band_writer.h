#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

/// Writes an image file from the top row down, some rows at a time, so that it never lies in memory
/// whole. The same bytes for the same image, however it is cut into bands.
///
///     EXR   32-bit float, not compressed: compression takes ten times as long as all the rest of a
///           solve and saves 4 % of a normal map, whose last bits are noise; channels R, G, B or Y
///     PNG   8 or 16 bits as given, grey or RGB
///
/// Errors  kIo: cannot be encoded or written; what is there then counts for nothing
class BandWriter {
 public:
  // Opens a file of 1 or 3 channels of T: float for EXR, uint8_t or uint16_t for PNG. A PNG tells
  // `pixel_mm`, the size of a pixel, in its pHYs chunk, as whole pixels per metre.
  template <typename T>
  [[nodiscard]] static Result<BandWriter> Open(const std::filesystem::path& path, ImageSize size,
                                               size_t channels,
                                               std::optional<double> pixel_mm = std::nullopt);
  BandWriter(BandWriter&& other) noexcept;
  BandWriter& operator=(BandWriter&& other) noexcept;
  BandWriter(const BandWriter&) = delete;
  BandWriter& operator=(const BandWriter&) = delete;
  ~BandWriter();

  // Writes the next rows: one image for each channel, all of one size and the file's width.
  [[nodiscard]] Status Write(std::span<const Image<float>> planes);
  [[nodiscard]] Status Write(std::span<const Image<uint8_t>> planes);
  [[nodiscard]] Status Write(std::span<const Image<uint16_t>> planes);
  // Completes the file after the last row.
  [[nodiscard]] Status Close();

 private:
  struct Impl;
  explicit BandWriter(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace sateen
