#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calibration/lights/light_fit.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_lights_compare.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "pipelines/calibrate/sheet_figures.h"

namespace sateen {

struct CalibrateLightsOptions {
  std::vector<std::filesystem::path> sheets;  // sessions; the flat one first
  std::filesystem::path output;               // the rig file
  std::filesystem::path rough_rig;            // empty: what is at `output`, or the session's own
  std::string border;                         // printed on the sheets; empty: none
  bool find_poses = false;                    // by the border, also where sessions record them
  LightModel highest_rung = LightModel::kLedField;
  double albedo = 0.99;  // of the paper, (0, 1]
};

// One light's fit and what was compared with it.
struct LightFigures {
  LightFit fit;
  double moved_mm = 0.0;  // from where the rough rig had it
  // Against truth/rig.json of a simulated sheet, where there is one.
  std::optional<double> position_error_mm;
  std::optional<double> direction_error_deg;  // worst among the samples
  std::optional<double> flux_error;           // worst channel, relative
};

struct LightsCalibration : RigCalibration {
  std::vector<SheetFigures> sheets;  // those whose pose was found by the border
  std::vector<LightFigures> lights;  // in the rig's order
  std::vector<WayFigures> ways;      // this fit is the last
  LightsRecord record;
};

/// Fits each light to sheets of white paper (calibration/lights/light_fit.h), draws the pictures of
/// lights_pictures.h and writes the rig with the new lights.
///
/// Errors   kInvalidArgument: the border's text, an option of the fit out of range
///          kBadData: the sheets' rigs differ; frames are swapped; as ReadSheet(), FitLight()
///          kCancelled: nothing is written
[[nodiscard]] Result<LightsCalibration> CalibrateLightsFromSheets(
    const CalibrateLightsOptions& options, const Task& task = {});

}  // namespace sateen
