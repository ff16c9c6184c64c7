#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iosfwd>

#include "cli/session_overview.h"
#include "core/task.h"

namespace sateen::cli {

// `sateen session verify`.
struct SessionVerifyArgs {
  std::filesystem::path session;
  bool json = false;
};

struct SessionArgs {
  SessionVerifyArgs verify;
  SessionOverviewArgs overview;
};

void AddSession(CLI::App& root, SessionArgs& args);

// Runs the subcommand of `sateen session` that was typed. Returns the exit status.
int RunSession(const CLI::App& root, const SessionArgs& args, const Task& task, std::ostream& out,
               std::ostream& log);
int RunSessionVerify(const SessionVerifyArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
