#pragma once

#include <filesystem>
#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"

namespace sateen::cli {

// `sateen session overview`.
struct SessionOverviewArgs {
  std::filesystem::path session;
  std::filesystem::path maps;    // of a solve of it; empty: frames alone
  std::filesystem::path output;  // PNG
};

void AddSessionOverview(CLI::App& session, SessionOverviewArgs& args);

// Returns the exit status.
int RunSessionOverview(const SessionOverviewArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log);

}  // namespace sateen::cli
