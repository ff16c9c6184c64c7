#pragma once

#include <filesystem>
#include <iosfwd>

#include "cli/command.h"
#include "core/task.h"

namespace sateen::cli {

// `sateen session verify`.
struct SessionVerifyArgs {
  std::filesystem::path session;
  bool json = false;
};

void AddSessionVerify(CLI::App& session, SessionVerifyArgs& args);

// Returns the exit status.
int RunSessionVerify(const SessionVerifyArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
