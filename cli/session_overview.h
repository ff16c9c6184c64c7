#pragma once

#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"
#include "pipelines/overview/session_overview.h"

namespace sateen::cli {

// `sateen session overview`.
struct SessionOverviewArgs {
  SessionOverviewOptions options;
};

void AddSessionOverview(CLI::App& session, SessionOverviewArgs& args);

// Returns the exit status.
int RunSessionOverview(const SessionOverviewArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log);

}  // namespace sateen::cli
