#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <string_view>

#include "core/task.h"

namespace sateen {

// One line on a terminal that shows how far the current stage is, redrawn at most ten times a
// second and cleared at the end. Writes nothing where `fd` is not a terminal.
class ProgressBar : public Progress {
 public:
  explicit ProgressBar(int fd);
  ~ProgressBar() override;

  void BeginStage(std::string_view name, int total) override;
  void Advance(int steps) override;
  void Clear() override;

 private:
  void Draw();

  const int fd_;
  const bool on_terminal_;
  std::mutex mutex_;  // for all below
  std::string stage_;
  int total_ = 0;
  int done_ = 0;
  std::chrono::steady_clock::time_point drawn_at_;
};

}  // namespace sateen
