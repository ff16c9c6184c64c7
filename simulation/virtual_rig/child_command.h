#pragma once

#include <sys/types.h>

#include <map>
#include <string>
#include <vector>

#include "core/error.h"

namespace sateen {

// Starts a command with these variables besides those of this process. Returns its process id.
// kInvalidArgument: it cannot be started; kIo: the system has no pipe.
[[nodiscard]] Result<pid_t> StartCommand(const std::vector<std::string>& command,
                                         const std::map<std::string, std::string>& environment);

// Returns the exit status as a shell has it: 128 and the signal's number if it was killed.
[[nodiscard]] int ExitStatusOf(int wait_status);

}  // namespace sateen
