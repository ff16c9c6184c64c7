#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_pose.h"

namespace sateen::cli {

struct CalibratePoseArgs {
  CalibratePoseOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibratePose(CLI::App& calibrate, CalibratePoseArgs& args);
int RunCalibratePose(const CalibratePoseArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
