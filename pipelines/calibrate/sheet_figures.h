#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calibration/sheet/sheet_pose.h"
#include "core/error.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen {

// Where a sheet lies, as its border tells.
struct SheetFigures {
  std::string name;  // its session's folder
  SheetPose pose;
  // Against truth/pose.json of a simulated sheet, where there is one.
  std::optional<double> tilt_error_deg;
  std::optional<double> position_error_mm;
};

// Of a sheet whose pose was found by its border. kIo, kBadData as ReadTruePose().
[[nodiscard]] Result<SheetFigures> FiguresOfSheet(const std::filesystem::path& dir,
                                                  const Sheet& sheet);

// Words on what of the sheet does not follow the fitted lights: a fold, the paper's edge. Nothing
// where it all does.
[[nodiscard]] std::optional<std::string> FaultOfSheet(const std::filesystem::path& dir,
                                                      const Sheet& sheet, const Lights& lights,
                                                      double albedo);

// A line a sheet, and an empty one; empty without any.
[[nodiscard]] std::string SheetsTable(const std::vector<SheetFigures>& sheets);
[[nodiscard]] nlohmann::json SheetsJson(const std::vector<SheetFigures>& sheets);

}  // namespace sateen
