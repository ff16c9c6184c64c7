#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_lens.h"

namespace sateen::cli {

struct CalibrateLensArgs {
  CalibrateLensOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibrateLens(CLI::App& calibrate, CalibrateLensArgs& args);
int RunCalibrateLens(const CalibrateLensArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
