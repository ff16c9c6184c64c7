#pragma once

#include "core/error.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "rig/rig.h"
#include "scanner/sessions/frames/sensor_reading.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Brightness of a frame: percentiles of its sites, each as a fraction of the way from black to
// saturation. All are 0 for an image that does not saturate.
struct SignalLevels {
  double peak = 0.0;       // 99.9th: what is brighter are a few glints
  double low = 0.0;        // 10th: the dark parts that still count
  double saturated = 0.0;  // share of the sites that do
};

// Measures the levels to 1/4096. Sites are counted as the sensor reads them, without white balance.
[[nodiscard]] SignalLevels LevelsOf(const RawMosaic& mosaic, const SensorReading& reading);
[[nodiscard]] SignalLevels LevelsOf(const Photo& photo);

// Reads the frame for its levels alone. Errors as ReadRawMosaic() and ReadPhoto().
[[nodiscard]] Result<SignalLevels> ReadSignalLevels(const FrameFile& file);

}  // namespace sateen
