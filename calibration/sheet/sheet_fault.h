#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibration/sheet/sheet_readings.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

enum class FaultShape { kLine, kRim, kSpots };

// Region of a sheet that the lights do not explain.
struct SheetFault {
  double share = 0.0;  // share of the sheet's blocks
  FaultShape shape = FaultShape::kSpots;
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();  // x, y in the table frame
  double length_mm = 0.0;                               // extent of nine tenths of its blocks
  double width_mm = 0.0;
  size_t worst_light = 0;  // light under which most of it shows
};

/// Finds a fold, dust, a stain or the paper's edge: blocks that deviate from the fitted lights by
/// more than five robust standard deviations, under at least two lights and a fifth of those that
/// see them. A deviation under a single light is not the paper's fault.
///
/// lights   fitted lights, in the order of the readings
/// Returns  nothing where such blocks are less than 0.4 % of the sheet
[[nodiscard]] std::optional<SheetFault> FindSheetFault(const SheetReadings& sheet,
                                                       const Lights& lights, double albedo);

}  // namespace sateen
