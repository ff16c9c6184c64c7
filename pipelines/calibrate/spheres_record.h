#pragma once

#include "pipelines/calibrate/calibrate_spheres.h"

namespace sateen {

// Direction of a light as a place in the sky.
struct SkyPlace {
  double elevation_deg;
  double azimuth_deg;  // from x to the right towards y up, [0, 360)
};

[[nodiscard]] SkyPlace PlaceInSky(const Eigen::Vector3d& l);

// Returns the record of a finished calibration.
[[nodiscard]] SpheresRecord RecordOf(const CalibrateSpheresOptions& options,
                                     const SpheresCalibration& result);

}  // namespace sateen
