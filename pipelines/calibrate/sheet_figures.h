#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calibration/sheet/sheet_pose.h"
#include "core/error.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {

// A sheet's pose, found by its border.
struct SheetFigures {
  std::string name;  // its session's folder
  SheetPose pose;
  // Against truth/pose.json of a simulated sheet, where there is one.
  std::optional<double> tilt_error_deg;
  std::optional<double> position_error_mm;
};

// Returns the figures of a sheet whose pose was found by its border. Fails as ReadTruePose().
[[nodiscard]] Result<SheetFigures> FiguresOfSheet(const std::filesystem::path& dir,
                                                  const Sheet& sheet);

// Describes the part of the sheet that does not follow the fitted lights: a fold, the paper's edge.
// Returns nothing where there is none.
[[nodiscard]] std::optional<std::string> FaultOfSheet(const std::filesystem::path& dir,
                                                      const Sheet& sheet, const Lights& lights,
                                                      double albedo);

// Return the angle between the normals of sheet and table, and its standard deviation.
[[nodiscard]] double TiltDeg(const SheetPose& pose);
[[nodiscard]] double TiltSdDeg(const SheetPose& pose);

}  // namespace sateen
