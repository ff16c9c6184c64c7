#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_lights.h"

namespace sateen::cli {

struct CalibrateLightsArgs {
  CalibrateLightsOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibrateLights(CLI::App& calibrate, CalibrateLightsArgs& args);
int RunCalibrateLights(const CalibrateLightsArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log);

}  // namespace sateen::cli
