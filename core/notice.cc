#include "core/notice.h"

#include <mutex>
#include <utility>

namespace sateen {
namespace {

struct Notices {
  std::mutex mutex;
  NoticeSink sink;
};

thread_local const NoticeSink* sink_of_thread = nullptr;

Notices& TheNotices() {
  static Notices notices;
  return notices;
}

}  // namespace

NoticesTo::NoticesTo(NoticeSink sink) {
  const std::lock_guard lock(TheNotices().mutex);
  former_ = std::exchange(TheNotices().sink, std::move(sink));
}

NoticesTo::~NoticesTo() {
  const std::lock_guard lock(TheNotices().mutex);
  TheNotices().sink = std::move(former_);
}

NoticesOfThread::NoticesOfThread(NoticeSink sink)
    : sink_(std::move(sink)), former_(std::exchange(sink_of_thread, &sink_)) {}

NoticesOfThread::~NoticesOfThread() { sink_of_thread = former_; }

void Notice(const std::string& text) {
  if (sink_of_thread != nullptr) {
    (*sink_of_thread)(text);
  }
  const std::lock_guard lock(TheNotices().mutex);
  if (TheNotices().sink) {
    TheNotices().sink(text);
  }
}

}  // namespace sateen
