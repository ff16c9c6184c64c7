#include "core/stray_thread.h"

#include <atomic>
#include <thread>
#include <utility>

namespace sateen {
namespace {

std::atomic<int> stray_threads = 0;

}  // namespace

void StartStray(std::function<void()> work) {
  ++stray_threads;
  try {
    std::thread([work = std::move(work)]() mutable {
      work();
      work = nullptr;  // what it owns goes before it counts as ended
      --stray_threads;
    }).detach();
  } catch (...) {
    --stray_threads;
    throw;
  }
}

int StrayThreads() { return stray_threads; }

}  // namespace sateen
