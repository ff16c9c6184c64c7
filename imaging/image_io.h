#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "imaging/image.h"
#include "imaging/picture_limit.h"

namespace sateen {

// How the numbers in an integer file relate to light. Float files are linear as they are.
enum class Encoding {
  kAuto,    // 8-bit files are sRGB, 16-bit files are linear
  kLinear,  // proportional to light
  kSrgb     // IEC 61966-2-1 transfer function
};

// A photograph as linear light, 1 = the file's full scale for integer files.
struct Photo {
  Image3 rgb;                       // a grey file has three equal planes
  std::optional<float> saturation;  // the value that means "saturated"; nothing for float files
  bool was_srgb = false;            // the transfer function was undone: 8-bit precision at best
};

/// Reads EXR, PNG, TIFF, TGA or JPEG, known by its content: 8 or 16-bit integer or float, one or
/// two channels as grey, three or four as RGB; the last of two or four (alpha) is not applied.
/// Float samples come as stored, infinities and NaN too. Of several pictures in a file the first.
///
/// Errors   kIo: as InputFile::Open()
///          kBadData: not an image, cut short, other sample types or channel counts, an EXR whose
///          data window is not its display window, a size that `limit` refuses
///          kOutOfMemory: with the size that was needed
[[nodiscard]] Result<Photo> ReadPhoto(const std::filesystem::path& path,
                                      Encoding encoding = Encoding::kAuto,
                                      const PictureLimit& limit = {});

// Returns the size of a picture by its header; no pixel is decoded. Errors as ReadPhoto().
[[nodiscard]] Result<ImageSize> ReadPhotoSize(const std::filesystem::path& path,
                                              const PictureLimit& limit = {});

// Reads three planes for normal maps and other data: floats exactly as stored, integers as a
// fraction of full scale. Fails with kBadData unless the file has three or four channels.
[[nodiscard]] Result<Image3> ReadImage3(const std::filesystem::path& path,
                                        const PictureLimit& limit = {});

// Reads 255 where any colour channel is at least half of full scale (1 for floats), otherwise 0.
[[nodiscard]] Result<Mask> ReadMask(const std::filesystem::path& path,
                                    const PictureLimit& limit = {});

// Returns true for the file name endings that ReadPhoto reads.
[[nodiscard]] bool IsPhotoName(const std::filesystem::path& path);

// Writers give the same bytes for the same image. kIo where the file cannot be written whole; what
// is there then counts for nothing (the caller writes through core/files/output_folder.h).
// EXR: 32-bit float, not compressed (imaging/band_writer.h); channels R, G, B or Y.
[[nodiscard]] Status WriteExr(const std::filesystem::path& path, const Image3& image);
[[nodiscard]] Status WriteExr(const std::filesystem::path& path, const Image<float>& image);
// PNG: integers as given, grey or RGB.
[[nodiscard]] Status WritePng8(const std::filesystem::path& path, const Image<uint8_t>& image);
[[nodiscard]] Status WritePng8(const std::filesystem::path& path,
                               const std::array<Image<uint8_t>, 3>& image);
[[nodiscard]] Status WritePng16(const std::filesystem::path& path,
                                const std::array<Image<uint16_t>, 3>& image);

// Returns the bytes of a JPEG file, sRGB, quality 90.
[[nodiscard]] Result<std::string> EncodeJpeg(const std::array<Image<uint8_t>, 3>& image);

}  // namespace sateen
