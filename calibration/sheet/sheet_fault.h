#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibration/sheet/sheet_readings.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

enum class FaultShape { kLine, kRim, kSpots };

// Where a sheet does not follow the lights.
struct SheetFault {
  double share = 0.0;  // of its blocks
  FaultShape shape = FaultShape::kSpots;
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();  // x, y in the table frame
  double length_mm = 0.0;                               // where nine of ten lie
  double width_mm = 0.0;
  size_t worst_light = 0;  // under which most of it shows
};

/// Blocks of one sheet that lie more than five robust standard deviations off what the fitted lights
/// would show, under at least two lights and a fifth of those that saw them: a fold, dust, a stain,
/// or what lies beyond the paper's edge. What a single light lacks is not the paper's fault.
///
/// lights   fitted, in the order of the readings
/// Returns  nothing where they are less than 0.4 % of the sheet
[[nodiscard]] std::optional<SheetFault> FindSheetFault(const SheetReadings& sheet,
                                                       const Lights& lights, double albedo);

}  // namespace sateen
