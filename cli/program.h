#pragma once

#include <iosfwd>

#include "core/task.h"

namespace sateen::cli {

// Parses the command line of `sateen` and runs the command that it names. Returns the exit status;
// 2 where the command line is wrong.
int RunProgram(int argc, const char* const* argv, const Task& task, std::ostream& out,
               std::ostream& log);

}  // namespace sateen::cli
