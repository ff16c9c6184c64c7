#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_check.h"

namespace sateen::cli {

struct CalibrateCheckArgs {
  CalibrationCheckOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibrateCheck(CLI::App& calibrate, CalibrateCheckArgs& args);
// Returns 3 where the calibration does not hold.
int RunCalibrateCheck(const CalibrateCheckArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log);

}  // namespace sateen::cli
