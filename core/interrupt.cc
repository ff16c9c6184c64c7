#include "core/interrupt.h"

#include <csignal>

#include "core/check.h"

namespace sateen {
namespace {

std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);  // or a handler may not touch it

void SetFlag(int /*signal*/) { interrupted = true; }

}  // namespace

void InstallInterruptHandlers() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action = {};
    SATEEN_CHECK(sigaction(signal, nullptr, &action) == 0);
    if (action.sa_handler == SIG_IGN) {  // nohup, or a shell's background job
      continue;
    }
    action = {};
    action.sa_handler = SetFlag;
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    SATEEN_CHECK(sigaction(signal, &action, nullptr) == 0);
  }
}

const std::atomic<bool>& InterruptFlag() { return interrupted; }

}  // namespace sateen
