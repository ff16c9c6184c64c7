#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_spheres.h"

namespace sateen::cli {

struct CalibrateSpheresArgs {
  CalibrateSpheresOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibrateSpheres(CLI::App& calibrate, CalibrateSpheresArgs& args);
int RunCalibrateSpheres(const CalibrateSpheresArgs& args, const Task& task, std::ostream& out,
                        std::ostream& log);

}  // namespace sateen::cli
