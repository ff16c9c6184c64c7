#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// Standard deviation of rounding to whole readings.
inline constexpr double kRoundingDn = 0.28867513459481287;

// Place in the 2x2 pattern of a mosaic: x % 2 + 2 (y % 2).
using BySite = std::array<float, 4>;

// How a frame's readings become radiance (imaging/light_stack.h):
// radiance = per_dn reading + at_zero.
struct MosaicFrame {
  BySite per_dn = {1.0F, 1.0F, 1.0F, 1.0F};
  BySite at_zero = {};
  // A site is saturated where it reads this or more; 65536: never.
  float saturated_dn = 65536.0F;
  // Noise of a reading [DN]: variance = gain_dn (reading - black) + read_dn^2. Both 0: not known.
  double gain_dn = 0.0;
  double read_dn = 0.0;
  std::string name;  // for messages: the file it came from
};

// Readings of K mosaics, whole in memory or not. Calls may come from any thread.
class MosaicRows {
 public:
  MosaicRows() = default;
  MosaicRows(const MosaicRows&) = delete;
  MosaicRows& operator=(const MosaicRows&) = delete;
  virtual ~MosaicRows() = default;

  // Rows [begin, end) of a frame, one after the other; they may lie in `buffer`. Empty where they
  // cannot be read.
  [[nodiscard]] virtual std::span<const uint16_t> Read(size_t frame, int begin, int end,
                                                       std::vector<uint16_t>& buffer) const = 0;
};

// Rows [begin, end) of an image.
[[nodiscard]] std::span<const uint16_t> RowsOf(const Image<uint16_t>& mosaic, int begin, int end);

// In memory.
class MosaicsInMemory final : public MosaicRows {
 public:
  explicit MosaicsInMemory(std::vector<Image<uint16_t>> mosaics) : mosaics_(std::move(mosaics)) {}
  [[nodiscard]] std::span<const uint16_t> Read(size_t frame, int begin, int end,
                                               std::vector<uint16_t>& buffer) const override;

 private:
  std::vector<Image<uint16_t>> mosaics_;
};

// The lit frames of a session as the sensor wrote them, one for each light, in the order of the
// lights, then the dark ones.
struct MosaicStack {
  ImageSize size_px;                // size of all frames
  std::array<uint8_t, 4> cfa = {};  // colour of each site: 0 red, 1 green, 2 blue
  std::vector<MosaicFrame> lit;
  std::vector<MosaicFrame> dark;  // their mean by `dark_weights` is subtracted
  std::vector<float> dark_weights;
  // Readings of the frames in the order lit, dark; never null in a stack that is solved. Copies of
  // the stack share them.
  std::shared_ptr<const MosaicRows> rows;
};

}  // namespace sateen
