#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/lights/light_fit.h"
#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_lights_compare.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "pipelines/calibrate/sheet_figures.h"
#include "rig/rig.h"

namespace sateen::cli {

struct CalibrateLightsArgs {
  std::vector<std::filesystem::path> sheets;
  std::filesystem::path output;  // the rig file
  std::filesystem::path rough_rig;
  std::string border;       // what is printed on the sheets; empty: nothing
  bool find_poses = false;  // by the border, also where sessions record them
  std::string highest_rung = "led+field";
  double albedo = 0.99;
  int threads = 0;
  bool json = false;
};

// What is known of a light beside its fit.
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
};

void AddCalibrateLights(CLI::App& calibrate, CalibrateLightsArgs& args);
int RunCalibrateLights(const CalibrateLightsArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log);

}  // namespace sateen::cli
