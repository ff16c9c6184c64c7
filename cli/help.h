#pragma once

#include "cli/command.h"

namespace sateen::cli {

// Makes the help of `app`, and of subcommands that are added to it later, fit 100 columns.
void WrapHelp(CLI::App& app);

}  // namespace sateen::cli
