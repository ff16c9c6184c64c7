#include "scanner/daemon/http/connection.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <pwd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <vector>

namespace sateen {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// How much is read of a client that is being refused.
constexpr std::size_t kDrainBytes = 1'048'576;

std::string UserName(uid_t uid) {
  std::vector<char> buffer(16384);
  passwd entry = {};
  passwd* found = nullptr;
  getpwuid_r(uid, &entry, buffer.data(), buffer.size(), &found);
  return found != nullptr ? found->pw_name : fmt::format("user {}", uid);
}

std::string ProgramName(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/comm", pid));
  std::string name;  // a program may give itself any
  if (!std::getline(file, name)) {
    return "";
  }
  std::ranges::replace_if(
      name, [](char c) { return c < 0x20 || c == 0x7f; }, '?');
  return fmt::format(" ({})", name);
}

bool IsUnixSocket(int fd) {
  int domain = 0;
  socklen_t size = sizeof domain;
  return getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &domain, &size) == 0 && domain == AF_UNIX;
}

}  // namespace

Connection::Connection(int fd, const ConnectionLimits& limits)
    : fd_(fd),
      gone_(static_cast<short>(POLLHUP | POLLERR | (IsUnixSocket(fd) ? 0 : POLLRDHUP))),
      limits_(limits),
      deadline_(steady_clock::now() + limits.read) {}

Connection::~Connection() {
  // A socket that is closed with something unread in it takes the answer away from the client.
  shutdown(fd_, SHUT_WR);
  const auto until = steady_clock::now() + limits_.drain;
  for (std::size_t drained = 0; drained < kDrainBytes;) {
    const auto left = std::chrono::duration_cast<milliseconds>(until - steady_clock::now());
    const bool waited = left.count() > 0 && WaitFor(POLLIN, left);
    const ssize_t count = waited ? recv(fd_, buffer_.data(), buffer_.size(), 0) : 0;
    if (count <= 0) {
      break;
    }
    drained += static_cast<std::size_t>(count);
  }
}

bool Connection::WaitFor(short what, milliseconds longest) const {
  pollfd entry = {.fd = fd_, .events = what};
  int ready = 0;
  const auto until = steady_clock::now() + longest;
  do {
    const auto left = std::chrono::duration_cast<milliseconds>(until - steady_clock::now());
    ready = poll(&entry, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
  } while (ready < 0 && errno == EINTR);
  return ready > 0;
}

bool Connection::HasLeft() const {
  pollfd entry = {.fd = fd_, .events = gone_};
  return poll(&entry, 1, 0) > 0 && (entry.revents & gone_) != 0;
}

Heard Connection::Read(std::string& into) {
  if (bytes_read_ >= limits_.request_bytes) {
    return Heard::kFull;
  }
  const auto left = std::chrono::duration_cast<milliseconds>(deadline_ - steady_clock::now());
  if (left.count() <= 0 || !WaitFor(POLLIN, left)) {
    return Heard::kLate;
  }
  const std::size_t most = std::min(buffer_.size(), limits_.request_bytes - bytes_read_);
  const ssize_t count = recv(fd_, buffer_.data(), most, 0);
  if (count <= 0) {
    return Heard::kEnd;
  }
  bytes_read_ += static_cast<std::size_t>(count);
  into.append(buffer_.data(), static_cast<std::size_t>(count));
  return Heard::kBytes;
}

bool Connection::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count =
        WaitFor(POLLOUT, limits_.write) ? send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) : -1;
    if (count <= 0) {
      return false;
    }
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

std::string Connection::PeerName() const {
  sockaddr_storage address = {};
  socklen_t size = sizeof address;
  auto* const generic = static_cast<sockaddr*>(static_cast<void*>(&address));
  if (getpeername(fd_, generic, &size) != 0) {
    return "a client that has gone";
  }
  if (address.ss_family == AF_UNIX) {
    ucred peer = {};
    socklen_t peer_size = sizeof peer;
    getsockopt(fd_, SOL_SOCKET, SO_PEERCRED, &peer, &peer_size);
    return fmt::format("process {}{} of {}", peer.pid, ProgramName(peer.pid), UserName(peer.uid));
  }
  const bool v6 = address.ss_family == AF_INET6;
  const std::uint16_t port =
      v6 ? static_cast<sockaddr_in6*>(static_cast<void*>(&address))->sin6_port
         : static_cast<sockaddr_in*>(static_cast<void*>(&address))->sin_port;
  return fmt::format("{} port {}", v6 ? "::1" : "127.0.0.1", ntohs(port));
}

}  // namespace sateen
