#pragma once

#include <atomic>

namespace sateen {

// From now on the first Ctrl-C (SIGINT) or SIGTERM sets InterruptFlag(), and a second one of the
// same kind ends the program at once. A signal that the parent process had ignored stays ignored.
void InstallInterruptHandlers();

// For Task::cancel.
[[nodiscard]] const std::atomic<bool>& InterruptFlag();

}  // namespace sateen
