// Any bytes go for what the process at the camera says. A message that was received is received the
// same when it is sent again.
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>

#include "fuzz/target.h"
#include "scanner/devices/worker_message.h"

namespace sateen::fuzz {
namespace {

// Two ends of a socket.
struct Pair {
  std::array<int, 2> ends = {};
  Pair() { Need(socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) == 0); }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;
  ~Pair() {
    close(ends[0]);
    close(ends[1]);
  }
};

}  // namespace

void Try(std::string_view bytes) {
  constexpr std::size_t kMostBytes = 100'000;  // which a socket takes at once
  bytes = bytes.substr(0, kMostBytes);
  const Pair pair;
  Need(send(pair.ends[0], bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
       static_cast<ssize_t>(bytes.size()));
  Need(shutdown(pair.ends[0], SHUT_WR) == 0);
  while (const auto message = ReceiveMessage(pair.ends[1], std::nullopt)) {
    const Pair other;
    Need(SendMessage(other.ends[0], *message).has_value());
    const auto again = ReceiveMessage(other.ends[1], std::nullopt);
    Need(again && *again == *message);
  }
}

}  // namespace sateen::fuzz
