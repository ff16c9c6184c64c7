#include "core/progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>

#include "core/printable.h"

namespace sateen {
namespace {

constexpr std::chrono::milliseconds kMinInterval{100};
constexpr size_t kNameWidth = 24;
constexpr size_t kLongNameWidth = 46;
constexpr size_t kNameAndBarWidth = 54;  // a longer name takes from the bar
constexpr int kLineWidth = 63;           // name, bar and percentage; fits any terminal

// A terminal that is gone is no reason to stop the work.
void Write(int fd, const std::string& text) {
  [[maybe_unused]] const ssize_t ignored = write(fd, text.data(), text.size());
}

}  // namespace

ProgressBar::ProgressBar(int fd) : fd_(fd), on_terminal_(isatty(fd) == 1) {}

ProgressBar::~ProgressBar() { Clear(); }

void ProgressBar::Clear() {
  const std::lock_guard lock(mutex_);
  if (on_terminal_ && !stage_.empty()) {
    Write(fd_, fmt::format("\r{:{}}\r", "", kLineWidth));
    stage_.clear();
  }
}

void ProgressBar::BeginStage(std::string_view name, int total) {
  if (!on_terminal_) {
    return;
  }
  const std::lock_guard lock(mutex_);
  stage_ = Printable(name);
  total_ = total;
  done_ = 0;
  Draw();
}

void ProgressBar::Advance(int steps) {
  if (!on_terminal_) {
    return;
  }
  const std::lock_guard lock(mutex_);
  const bool is_first = done_ == 0;  // a stage that begins in the middle shows so at once
  done_ += steps;
  if (!stage_.empty() &&
      (is_first || std::chrono::steady_clock::now() - drawn_at_ >= kMinInterval)) {
    Draw();
  }
}

void ProgressBar::Draw() {
  const int64_t total = std::max(1, total_);
  const int64_t done = std::clamp<int64_t>(done_, 0, total);
  const size_t name_width = std::clamp(stage_.size(), kNameWidth, kLongNameWidth);
  const size_t bar_width = kNameAndBarWidth - name_width;
  const std::string filled(bar_width * static_cast<size_t>(done) / static_cast<size_t>(total), '#');
  Write(fd_, fmt::format("\r{:{}.{}} [{:{}}] {:3} %", stage_, name_width, name_width, filled,
                         bar_width, 100 * done / total));
  drawn_at_ = std::chrono::steady_clock::now();
}

}  // namespace sateen
