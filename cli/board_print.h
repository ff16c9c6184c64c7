#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>

#include "cli/command.h"
#include "core/task.h"

namespace sateen::cli {

// `sateen board print`.
struct BoardPrintArgs {
  std::string spec;
  std::string paper;  // empty: A4, or a sheet's own
  std::filesystem::path output;
  double dpi = 300.0;  // of a PNG
  bool json = false;
};

void AddBoardPrint(CLI::App& board, BoardPrintArgs& args);

// Returns the exit status.
int RunBoardPrint(const BoardPrintArgs& args, const Task& task, std::ostream& out,
                  std::ostream& log);

}  // namespace sateen::cli
