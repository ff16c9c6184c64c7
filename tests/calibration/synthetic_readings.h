#pragma once

#include <vector>

#include "calibration/sheet/sheet_readings.h"
#include "rig/rig.h"
#include "simulation/rigs.h"
#include "tests/calibration/synthetic_sheets.h"

namespace sateen::testing {

// The scanner of The Order: 1886; every light has a flux of its own.
inline Rig CalibratedRig(LightModel model = LightModel::kNear, ImageSize size = {4928, 3264}) {
  Rig rig = RingRig(size, model, 300.0);
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    rig.lights[k].flux_rgb =
        Eigen::Vector3d(0.40, 0.36, 0.30) * (1.0 + 0.02 * static_cast<double>(k));
  }
  for (Light& light : rig.lights) {
    if (model == LightModel::kLedField) {
      light.field = {.origin_mm = {-300.0, -300.0}, .spacing_mm = 100.0, .columns = 7, .rows = 7};
      light.field.gain.assign(49, 1.0);
      light.field.gain[24] = 1.1;  // a bright middle
    }
  }
  return rig;
}

// Number of blocks of a frame.
struct ReadingsGrid {
  int columns = 18;
  int rows = 12;
};

// Returns blocks as `actual` shows them, at the places that the camera of `rig` gives.
inline std::vector<SheetReadings> ReadingsOf(const Rig& rig, const Rig& actual, int sheets,
                                             uint64_t seed, ReadingsGrid grid = {}) {
  const SyntheticCamera expects{.camera = *rig.camera, .columns = grid.columns, .rows = grid.rows};
  const SyntheticCamera sees{.camera = *actual.camera, .columns = grid.columns, .rows = grid.rows};
  const auto blocks = static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows);
  std::vector<SheetReadings> readings(static_cast<size_t>(sheets),
                                      {.columns = grid.columns, .rows = grid.rows});
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    const std::vector<SheetSample> at = SamplesOf(expects, rig.lights[k], sheets, 0);
    const std::vector<SheetSample> is = SamplesOf(sees, actual.lights[k], sheets, 1000 * seed + k);
    for (size_t s = 0; s < readings.size(); ++s) {
      std::vector<SheetSample>& samples = readings[s].samples.emplace_back();
      std::vector<int>& places = readings[s].blocks.emplace_back();
      for (size_t j = 0; j < blocks; ++j) {
        SheetSample sample = is[s * blocks + j];
        sample.point_mm = at[s * blocks + j].point_mm;
        samples.push_back(sample);
        places.push_back(static_cast<int>(j));
      }
    }
  }
  return readings;
}

}  // namespace sateen::testing
