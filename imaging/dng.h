#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Header of a Bayer RAW file: all that it holds besides its samples.
struct DngHeader {
  // Colour (0 red, 1 green, 2 blue) at (x, y) = 00 10 01 11; two greens on a diagonal.
  std::array<uint8_t, 4> cfa = {0, 1, 1, 2};
  // Readings of no light and of saturation. [DN], whole, 0 <= black < white <= 65535
  double black = 0.0;
  double white = 65535.0;
  // 1 to 63 printable ASCII characters each, no space at either end.
  std::string make = "Sateen";
  std::string model = "Simulated";
  // From XYZ to camera RGB under D65, row-major; as it is, the camera sees linear sRGB.
  // Each within [-100, 100].
  std::array<double, 9> color_matrix = {3.2404542, -1.5371385, -0.4985314, -0.9692660, 1.8760108,
                                        0.0415560, 0.0556434,  -0.2040259, 1.0572252};
  // Camera RGB of a neutral patch (AsShotNeutral). Each within [1e-4, 1e4].
  std::array<double, 3> neutral = {1.0, 1.0, 1.0};
  std::optional<double> exposure_s;  // [1e-6, 1e5]
  std::optional<double> f_number;    // [0.01, 1e4]
  std::optional<double> iso;         // whole, 1 to 65535
  // "YYYY:MM:DD HH:MM:SS". From the caller and not from the clock: same input, same file.
  std::optional<std::string> date_time;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Writes a sensor's readings as an uncompressed 16-bit Bayer DNG 1.4 (through libtiff), whole or
/// not at all; its folder must exist. Every reading is stored as it is, also above `white`, and
/// the same input gives the same bytes. Callable from several threads.
///
/// mosaic   [DN], at least 2x2, sides up to 65535 px, up to 2^30 sites. LibRaw, and with it
///          ReadRawMosaic(), takes nothing below 22x22 for a photograph.
/// Errors   kInvalidArgument: a field of `header` out of range, or the mosaic's size
///          kIo: the file cannot be written
[[nodiscard]] Status WriteDng(const std::filesystem::path& path, const Image<uint16_t>& mosaic,
                              const DngHeader& header);

// Returns the same file as bytes. kInvalidArgument as above; kIo where libtiff has no memory.
[[nodiscard]] Result<std::string> EncodeDng(const Image<uint16_t>& mosaic, const DngHeader& header);

}  // namespace sateen
