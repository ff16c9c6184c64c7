#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/simulate/simulate.h"

namespace sateen::cli {

struct SimulateArgs {
  SimulateOptions options;
  bool linear = false;
  bool list = false;
  int threads = 0;  // 0: one for each core
};

void AddSimulate(CLI::App& root, SimulateArgs& args);

// Returns the exit status.
int RunSimulate(const SimulateArgs& args, const Task& task, std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
