#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "calibration/check/light_check.h"
#include "cli/command.h"
#include "core/task.h"
#include "scanner/sessions/sheet_reader.h"

namespace sateen::cli {

struct CalibrateCheckArgs {
  std::vector<std::filesystem::path> sheets;
  std::filesystem::path rig;     // empty: the session's own
  std::string border;            // what is printed on the sheets; empty: nothing
  std::filesystem::path output;  // folder for pictures and the report; empty: none
  LightCheckOptions options;
  double max_ambient_percent = 5.0;  // of the dimmest light
  int threads = 0;
  bool json = false;
};

// Everything that a report speaks of.
struct CalibrationCheck {
  Rig rig;
  RigCheck check;
  std::vector<std::string> faults;  // what does not hold, each with what to do
  std::vector<std::string> notes;   // what is no fault but worth knowing
  double ambient_percent = 0.0;     // the dark frame over the dimmest light
  std::map<std::string, std::string> sha256_of_input;
  double seconds = 0.0;
};

void AddCalibrateCheck(CLI::App& calibrate, CalibrateCheckArgs& args);
// Returns 3 where the calibration does not hold.
int RunCalibrateCheck(const CalibrateCheckArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log);

}  // namespace sateen::cli
