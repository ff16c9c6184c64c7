#pragma once

#include <atomic>
#include <string_view>

#include "core/error.h"

namespace sateen {

// Told how far a long operation has come. Calls may come from any thread.
class Progress {
 public:
  Progress() = default;
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  virtual ~Progress() = default;

  // Starts a stage of `total` steps; the stage before it is complete.
  virtual void BeginStage(std::string_view name, int total) = 0;
  virtual void Advance(int steps) = 0;
  // Makes room for other output; the next stage shows itself again.
  virtual void Clear() = 0;
};

// Conditions that a long operation runs under. The default runs silently, on all cores, to its end.
struct Task {
  // Threads to use; 0 means one for each core.
  int threads = 0;
  Progress* progress = nullptr;
  // Set, by a signal handler or another thread, to make the operation stop with kCancelled.
  const std::atomic<bool>* cancel = nullptr;

  [[nodiscard]] bool Cancelled() const { return cancel != nullptr && cancel->load(); }
  // Fails with kCancelled once `cancel` is set.
  [[nodiscard]] Status CheckCancelled() const;
  [[nodiscard]] int ThreadCount() const;
  // Returns the same on another number of threads.
  [[nodiscard]] Task WithThreads(int count) const {
    return {.threads = count, .progress = progress, .cancel = cancel};
  }
  void BeginStage(std::string_view name, int total) const;
  void Advance(int steps = 1) const;
  void ClearProgress() const;
};

}  // namespace sateen
