#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "core/error.h"
#include "imaging/image.h"
#include "imaging/picture_limit.h"

namespace sateen {

// A camera RAW file as the sensor saw it: one colour per site, linear, black subtracted,
// 1 = white level. Values below black stay negative; some sensors read a little above white.
struct RawMosaic {
  Image<float> samples;  // the visible area, at least 2x2, as the sensor lies (unrotated)
  std::array<uint8_t, 4> cfa = {};  // colour (0 red, 1 green, 2 blue) at (x, y) = 00 10 01 11
  float black = 0.0F;               // [DN], mean over the four sites
  float white = 0.0F;               // [DN]
  // As shot, green = 1; all 1 where the file does not say. Not applied to the samples.
  std::array<float, 3> camera_white_balance = {1.0F, 1.0F, 1.0F};
  std::string camera;  // make and model
  std::optional<double> exposure_s;
  std::optional<double> f_number;
  std::optional<double> iso;
};

// The same as integers, while the decoder holds them.
struct RawReadings {
  ImageSize size_px;                // size of the visible area
  std::array<uint8_t, 4> cfa = {};  // as in RawMosaic
  std::array<float, 4> black = {};  // [DN], per site of the four
  float white = 0.0F;               // [DN]
  const uint16_t* first = nullptr;  // reading of site (0, 0)
  size_t pitch = 0;                 // from row to row, in readings

  [[nodiscard]] std::span<const uint16_t> Row(int y) const {
    return {first + pitch * static_cast<size_t>(y), static_cast<size_t>(size_px.width)};
  }
};

// Returns true for the file name endings of camera RAW files.
[[nodiscard]] bool IsRawName(const std::filesystem::path& path);

/// Decodes a camera RAW file (through LibRaw): no auto brightness, no white balance, no
/// colour matrix; black and white level applied.
///
/// Errors   kIo: as InputFile::Open()
///          kBadData: not a RAW file that can be decoded, cut short, its CFA is not 2x2 Bayer, or a
///          size that `limit` refuses
///          kOutOfMemory: with the size that was needed
[[nodiscard]] Result<RawMosaic> ReadRawMosaic(const std::filesystem::path& path,
                                              const PictureLimit& limit = {});

// Returns the size of the visible area by the file's header; no sample is decoded. Errors as
// ReadRawMosaic().
[[nodiscard]] Result<ImageSize> ReadRawSize(const std::filesystem::path& path,
                                            const PictureLimit& limit = {});

// Decodes as ReadRawMosaic, and hands `take` the readings, which are gone when it returns. Nothing
// of the image's size is kept beside what the decoder needs. Errors of `take` are passed on.
[[nodiscard]] Status TakeRawReadings(const std::filesystem::path& path,
                                     const std::function<Status(const RawReadings&)>& take,
                                     const PictureLimit& limit = {});

// Returns camera RGB at every pixel. Bilinear: the mean of the nearest sites of each colour;
// measured values are kept as they are at their own sites. At the border the mosaic continues as
// its mirror image about the outermost row or column, which keeps the colours in their places.
// Channels are multiplied by `white_balance`, which is 1 unless asked: pass the chart's, or
// mosaic.camera_white_balance.
[[nodiscard]] Image3 Demosaic(const RawMosaic& mosaic,
                              const std::array<float, 3>& white_balance = {1.0F, 1.0F, 1.0F});

}  // namespace sateen
