#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "scanner/daemon/job.h"

namespace sateen {

// Server-sent events out of the pieces in which they come.
class EventParser {
 public:
  // `take` gets each event that is complete.
  explicit EventParser(std::function<void(const JobEvent&)> take);
  void Add(std::string_view piece);

 private:
  void TakeLine(std::string_view line);

  std::function<void(const JobEvent&)> take_;
  std::string line_;  // part of the line that has come
  JobEvent event_;
};

}  // namespace sateen
