#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/calibrate_response.h"

namespace sateen::cli {

struct CalibrateResponseArgs {
  CalibrateResponseOptions options;
  int threads = 0;
  bool json = false;
};

void AddCalibrateResponse(CLI::App& calibrate, CalibrateResponseArgs& args);
int RunCalibrateResponse(const CalibrateResponseArgs& args, const Task& task, std::ostream& out,
                         std::ostream& log);

}  // namespace sateen::cli
