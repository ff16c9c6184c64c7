#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "calibration/sheet/sheet_readings.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct FlatnessOptions {
  // Side of a tile, about: what is averaged before the worst is looked for. [mm], > 0. Half a period
  // of the waves of 50 mm and more that calibration answers for.
  double tile_mm = 25.0;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Angles between the normal that was solved and that of the sheet.
struct Flatness {
  double worst_rad = 0.0;  // of all tiles, edge to edge
  double rms_rad = 0.0;
  int tiles = 0;
};

// What light k does at its sample i.
using IncidentOf = std::function<Incident(size_t light, size_t sample)>;

/// How flat a sheet of paper, whose normal n_0 is known, solves with these lights:
///
///     N_b = argmin sum_k (i'_kb - N . l_kb)^2  for each block b, i' as in solver/lambertian.h   (1)
///     error of a tile = angle(n_0, n_0 + median over its blocks of (N_b / |N_b| - n_0))         (2)
///
/// The median, by component in the sheet's own plane and normal, leaves out dust and specks. It needs no
/// truth; but a sheet that also calibrated the lights vouches for them only as far as a model can be
/// wrong: an intensity for each pixel makes its own sheet flat whatever the lights' directions are.
///
/// Errors  kInvalidArgument: an option out of range
///         kDegenerate: no tile whose blocks are seen under three lights
/// Cost    about 1 us a block
[[nodiscard]] Result<Flatness> FlatnessOf(const SheetReadings& sheet, const IncidentOf& incident,
                                          const FlatnessOptions& options = {});

// With these lights as rig/light.h has them.
[[nodiscard]] Result<Flatness> FlatnessOf(const SheetReadings& sheet, const Lights& lights,
                                          const FlatnessOptions& options = {});

}  // namespace sateen
