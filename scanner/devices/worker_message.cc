#include "scanner/devices/worker_message.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>

#include "core/json.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr size_t kLongestMessage = size_t{1} << 20;

tl::unexpected<Error> Gone() {
  return Fail(ErrorCode::kDevice, "the process that talks to the camera has ended");
}

// kTimeout when `deadline` has passed.
Status WaitReadable(int socket, std::optional<steady_clock::time_point> deadline) {
  while (true) {
    int wait_ms = -1;
    if (deadline) {
      const auto left = std::chrono::ceil<milliseconds>(*deadline - steady_clock::now()).count();
      wait_ms = static_cast<int>(std::clamp<int64_t>(left, 0, 1'000'000));
    }
    pollfd wait = {.fd = socket, .events = POLLIN, .revents = 0};
    const int ready = poll(&wait, 1, wait_ms);
    if (ready > 0) {
      return {};
    }
    if (ready < 0 && errno != EINTR) {
      return Gone();
    }
    if (deadline && steady_clock::now() >= *deadline) {
      return Fail(ErrorCode::kTimeout, "no answer in time");
    }
  }
}

Status ReceiveAll(int socket, char* bytes, size_t size,
                  std::optional<steady_clock::time_point> deadline) {
  for (size_t done = 0; done < size;) {
    if (Status readable = WaitReadable(socket, deadline); !readable) {
      return readable;
    }
    const ssize_t got = recv(socket, bytes + done, size - done, 0);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
      continue;
    }
    if (got <= 0) {
      return Gone();
    }
    done += static_cast<size_t>(got);
  }
  return {};
}

}  // namespace

Status SendMessage(int socket, const nlohmann::json& message) {
  // A camera's names may hold any bytes.
  const std::string text = message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string bytes;
  for (int k = 0; k < 4; ++k) {
    bytes.push_back(static_cast<char>(text.size() >> (8 * k) & 0xFF));
  }
  bytes += text;
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t sent = send(socket, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) {
      continue;
    }
    if (sent <= 0) {
      return Gone();
    }
    done += static_cast<size_t>(sent);
  }
  return {};
}

Result<nlohmann::json> ReceiveMessage(int socket, std::optional<milliseconds> longest) {
  std::optional<steady_clock::time_point> deadline;
  if (longest) {
    deadline = steady_clock::now() + *longest;
  }
  std::array<char, 4> head = {};
  if (Status received = ReceiveAll(socket, head.data(), head.size(), deadline); !received) {
    return tl::unexpected(received.error());
  }
  size_t size = 0;
  for (size_t k = 0; k < head.size(); ++k) {
    size |= static_cast<size_t>(static_cast<unsigned char>(head[k])) << (8 * k);
  }
  std::string text(std::min(size, kLongestMessage), '\0');
  if (Status received = ReceiveAll(socket, text.data(), text.size(), deadline); !received) {
    return tl::unexpected(received.error());
  }
  Result<nlohmann::json> message = ParseJson(text, "message");  // not nested without end
  if (size > kLongestMessage || !message || !message->is_object()) {
    return Fail(ErrorCode::kDevice, "the process that talks to the camera sent no message");
  }
  return message;
}

}  // namespace sateen
