#pragma once

#include <functional>
#include <string>

namespace sateen {

// Is told, from any thread, what is neither result nor error: files that an earlier run left, or
// that are not ours, and what becomes of them.
using NoticeSink = std::function<void(const std::string&)>;

// Hands notices to `sink` as long as this lives; before and after it they go nowhere.
class NoticesTo {
 public:
  explicit NoticesTo(NoticeSink sink);
  NoticesTo(const NoticesTo&) = delete;
  NoticesTo& operator=(const NoticesTo&) = delete;
  ~NoticesTo();

 private:
  NoticeSink former_;
};

// Hands the notices of the thread that makes this to `sink`, too, as long as this lives. For work
// that somebody waits for, beside other work whose notices are not theirs.
class NoticesOfThread {
 public:
  explicit NoticesOfThread(NoticeSink sink);
  NoticesOfThread(const NoticesOfThread&) = delete;
  NoticesOfThread& operator=(const NoticesOfThread&) = delete;
  ~NoticesOfThread();

 private:
  NoticeSink sink_;
  const NoticeSink* former_;
};

void Notice(const std::string& text);

}  // namespace sateen
