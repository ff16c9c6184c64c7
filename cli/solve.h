#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/solve/solve_options.h"

namespace sateen::cli {

struct SolveArgs {
  SolveOptions options;
  int threads = 0;  // 0: one for each core
  bool json = false;
};

void AddSolve(CLI::App& root, SolveArgs& args);

// Returns the exit status.
int RunSolve(const SolveArgs& args, const Task& task, std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
