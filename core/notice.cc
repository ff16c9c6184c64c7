#include "core/notice.h"

#include <mutex>
#include <utility>

namespace sateen {
namespace {

struct Notices {
  std::mutex mutex;
  NoticeSink sink;
};

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

void Notice(const std::string& text) {
  const std::lock_guard lock(TheNotices().mutex);
  if (TheNotices().sink) {
    TheNotices().sink(text);
  }
}

}  // namespace sateen
