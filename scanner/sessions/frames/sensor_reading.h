#pragma once

#include <array>
#include <cstddef>

#include "core/error.h"
#include "imaging/raw.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

/// Turns a frame's value into balanced radiance (times its exposure), by the response of the rig
/// for which it is read:
///
///     v' = w_c (v + shift),     shift = (black_file - black) / (white_file - black_file)    (1)
///     saturation = (min(white, white_file) - black_file) / (white_file - black_file)        (2)
///
/// v is the file's own fraction of the way from its black to its white level, so that a measured
/// black or white never changes the unit of radiance; w is the rig's white balance, which every
/// frame of the rig gets, sheet and fabric alike, so that the lights' fluxes are balanced too.
/// Without a response v' = v and saturation = 1.
struct SensorReading {
  std::array<float, 3> balance = {1.0F, 1.0F, 1.0F};
  float shift = 0.0F;
  float saturation = 1.0F;  // v from which on a site counts as saturated

  [[nodiscard]] float Value(float v, size_t colour) const {
    return balance[colour] * (v + shift);  // (1)
  }
  [[nodiscard]] float Largest() const;
  // Returns where the last channel saturates.
  [[nodiscard]] float FullScale() const { return Largest() * (saturation + shift); }
};

// Returns the reading of a camera RAW file. kBadData where the rig's levels cannot be those of the
// file.
[[nodiscard]] Result<SensorReading> ReadingOf(const FrameFile& file, const RawMosaic& mosaic);

// Returns the reading of other files, whose levels are not the sensor's: the balance alone.
[[nodiscard]] SensorReading ReadingOf(const FrameFile& file);

}  // namespace sateen
