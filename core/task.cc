#include "core/task.h"

#include <algorithm>
#include <thread>

namespace sateen {

Status Task::CheckCancelled() const {
  if (Cancelled()) {
    return Fail(ErrorCode::kCancelled, "cancelled; nothing was written");
  }
  return {};
}

int Task::ThreadCount() const {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void Task::BeginStage(std::string_view name, int total) const {
  if (progress != nullptr) {
    progress->BeginStage(name, total);
  }
}

void Task::Advance(int steps) const {
  if (progress != nullptr) {
    progress->Advance(steps);
  }
}

void Task::ClearProgress() const {
  if (progress != nullptr) {
    progress->Clear();
  }
}

}  // namespace sateen
