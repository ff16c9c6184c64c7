#pragma once

#include <filesystem>
#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"

namespace sateen::cli {

struct SimulateArgs {
  std::filesystem::path scene;
  std::filesystem::path output;
  bool linear = false;
  bool list = false;
  int threads = 0;
};

void AddSimulate(CLI::App& root, SimulateArgs& args);
int RunSimulate(const SimulateArgs& args, const Task& task, std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
