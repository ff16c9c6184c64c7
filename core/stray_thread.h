#pragma once

#include <functional>

namespace sateen {

/// Runs `work` in a thread that nobody waits for: a call of the system that never returns, as
/// reading from a disk that has gone, then holds nobody up. `work` must own all that it uses.
///
/// Throws std::system_error where the system has no more threads.
void StartStray(std::function<void()> work);

// Returns how many stray threads run. A program with one ends by std::_Exit(), which runs no
// destructors under it.
[[nodiscard]] int StrayThreads();

}  // namespace sateen
