#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calibration/check/light_check.h"
#include "core/task.h"
#include "rig/rig.h"

namespace sateen {

struct CalibrationCheckOptions {
  std::vector<std::filesystem::path> sheets;  // sessions; a flat one first
  std::filesystem::path rig;                  // empty: the session's own
  std::string border;                         // printed on the sheets; empty: none
  std::filesystem::path output;               // folder for pictures and the report; empty: none
  LightCheckOptions check;
  double max_ambient_percent = 5.0;  // of the dimmest light
};

struct CalibrationCheck {
  Rig rig;
  RigCheck check;
  std::vector<std::string> faults;  // what does not hold, each with what to do
  std::vector<std::string> notes;   // no faults, but worth knowing
  double ambient_percent = 0.0;     // the dark frame over the dimmest light
  std::map<std::string, std::string> sha256_of_input;
  double seconds = 0.0;
};

/// Tells from sheets of white paper whether a rig's calibration still holds
/// (calibration/check/light_check.h). Writes into options.output: check.json, the report of
/// check_report.h, and ratio.png, ratio-2.png for the second sheet, as check_pictures.h draws them.
///
/// Errors   kInvalidArgument: an option out of range
///          kBadData: the sheets' rigs differ; the rig was never calibrated
///          as ReadSheet(), CheckRig()
///          kCancelled: nothing is written
[[nodiscard]] Result<CalibrationCheck> CheckCalibration(const CalibrationCheckOptions& options,
                                                        const Task& task = {});

}  // namespace sateen
