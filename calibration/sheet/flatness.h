#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "calibration/sheet/sheet_readings.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct FlatnessOptions {
  // Side of the tiles over which deviations are averaged, about. [mm], > 0. Calibration answers for
  // waves of 50 mm and more; a tile is half a period.
  double tile_mm = 25.0;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

// Angles between the solved normal and that of the sheet.
struct Flatness {
  double worst_rad = 0.0;  // largest of all tiles, edge to edge
  double rms_rad = 0.0;
  int tiles = 0;
};

// Returns the incident light of one light at one of its samples.
using IncidentOf = std::function<Incident(size_t light, size_t sample)>;

/// Measures how flat a sheet of paper, whose normal n_0 is known, solves with these lights:
///
///     N_b = argmin sum_k (i'_kb - N . l_kb)^2,  i'_kb = i_kb / e_kb, for each block b          (1)
///     error of a tile = angle(n_0, n_0 + median over its blocks of (N_b / |N_b| - n_0))        (2)
///
/// The median by component leaves out dust and specks. No truth is needed. A sheet that calibrated
/// the lights is a weak test of them: with an intensity for each pixel it would solve flat whatever
/// the lights' directions are.
///
/// Errors  kInvalidArgument: an option out of range
///         kDegenerate: no tile whose blocks are seen under three lights
/// Cost    about 1 us per block
[[nodiscard]] Result<Flatness> FlatnessOf(const SheetReadings& sheet, const IncidentOf& incident,
                                          const FlatnessOptions& options = {});

// Measures the same with the lights of rig/light.h.
[[nodiscard]] Result<Flatness> FlatnessOf(const SheetReadings& sheet, const Lights& lights,
                                          const FlatnessOptions& options = {});

}  // namespace sateen
