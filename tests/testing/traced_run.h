#pragma once

#include <functional>

namespace sateen::testing {

struct TracedRun {
  int calls = 0;  // system calls passed that change files
  bool is_killed = false;
  int exit_status = -1;  // of a run that was not killed
};

// Runs `body` in a process of its own and kills it as kill -9 does when it is about to make its
// system call `kill_at`, from 0, of those that change files: creating, writing, flushing, locking,
// renaming, removing; below 0: never. `body` may replace its program; its threads and children
// count too. Needs ptrace() and seccomp, which Linux has.
[[nodiscard]] TracedRun RunTraced(const std::function<int()>& body, int kill_at = -1);

}  // namespace sateen::testing
