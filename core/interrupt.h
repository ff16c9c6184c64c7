#pragma once

#include <atomic>

namespace sateen {

// Makes the first Ctrl-C (SIGINT), SIGTERM or SIGHUP (the terminal was closed) from now on set
// InterruptFlag(), and a second one of the same kind end the program at once. A signal that the
// parent process had ignored stays ignored.
void InstallInterruptHandlers();

// Returns the flag for Task::cancel.
[[nodiscard]] const std::atomic<bool>& InterruptFlag();

}  // namespace sateen
