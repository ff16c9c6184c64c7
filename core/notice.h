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

void Notice(const std::string& text);

}  // namespace sateen
