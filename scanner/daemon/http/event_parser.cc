#include "scanner/daemon/http/event_parser.h"

#include <charconv>
#include <utility>

namespace sateen {

EventParser::EventParser(std::function<void(const JobEvent&)> take) : take_(std::move(take)) {}

void EventParser::Add(std::string_view piece) {
  for (const char c : piece) {
    if (c == '\n') {
      TakeLine(std::exchange(line_, {}));
    } else {
      line_ += c;
    }
  }
}

void EventParser::TakeLine(std::string_view line) {
  const auto value_of = [&](std::string_view key) {
    return line.starts_with(key) ? line.substr(key.size()) : std::string_view();
  };
  if (line.empty()) {
    if (!event_.type.empty()) {
      take_(event_);
    }
    event_ = {};
  } else if (const std::string_view id = value_of("id: "); !id.empty()) {
    std::from_chars(id.data(), id.data() + id.size(), event_.sequence);
  } else if (const std::string_view type = value_of("event: "); !type.empty()) {
    event_.type = type;
  } else if (const std::string_view data = value_of("data: "); !data.empty()) {
    event_.data = data;
  }
}

}  // namespace sateen
