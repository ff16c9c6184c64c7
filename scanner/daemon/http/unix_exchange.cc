#include "scanner/daemon/http/unix_exchange.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <system_error>

#include "scanner/daemon/http/http_message.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;

// A descriptor that is closed at the end of its scope.
class Socket {
 public:
  explicit Socket(int flags) : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | flags, 0)) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (fd_ >= 0) {
      close(fd_);
    }
  }
  [[nodiscard]] int Get() const { return fd_; }

  // Makes calls of the kind `option`, SO_SNDTIMEO or SO_RCVTIMEO, fail after `limit`.
  void Limit(int option, milliseconds limit) const {
    const timeval time = {.tv_sec = limit.count() / 1000,
                          .tv_usec = static_cast<suseconds_t>(limit.count() % 1000 * 1000)};
    setsockopt(fd_, SOL_SOCKET, option, &time, sizeof time);
  }

 private:
  int fd_;
};

std::optional<sockaddr_un> AddressOf(const std::filesystem::path& path) {
  sockaddr_un address = {.sun_family = AF_UNIX};
  if (path.native().size() >= sizeof address.sun_path) {
    return std::nullopt;
  }
  std::memcpy(address.sun_path, path.c_str(), path.native().size() + 1);
  return address;
}

bool Connect(int fd, const sockaddr_un& address) {
  return connect(fd, static_cast<const sockaddr*>(static_cast<const void*>(&address)),
                 sizeof address) == 0;
}

std::string LastError() { return std::generic_category().message(errno); }

tl::unexpected<ExchangeFault> Fault(bool while_reading, std::string why) {
  return tl::unexpected(ExchangeFault{while_reading, std::move(why)});
}

tl::expected<int, ExchangeFault> ReadAnswer(
    const Socket& socket, const ExchangePatience& patience,
    const std::function<void(int status, std::string_view piece)>& take) {
  HttpResponseParser parser;
  std::array<char, 16384> buffer = {};
  while (!parser.Done()) {
    const ssize_t count = recv(socket.Get(), buffer.data(), buffer.size(), 0);
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return Fault(true, errno == EAGAIN
                             ? fmt::format("no answer within {:g} s",
                                           std::chrono::duration<double>(patience.silence).count())
                             : LastError());
    }
    const Status read =
        count == 0 ? parser.End() : parser.Add({buffer.data(), static_cast<std::size_t>(count)});
    if (parser.StatusCode() != 0) {
      take(parser.StatusCode(), parser.TakeBody());
    }
    if (!read) {
      return Fault(true, read.error().message);
    }
  }
  return parser.StatusCode();
}

}  // namespace

tl::expected<int, ExchangeFault> ExchangeOnUnixSocket(
    const std::filesystem::path& socket, std::string_view request, const ExchangePatience& patience,
    const std::function<void(int status, std::string_view piece)>& take) {
  const std::optional<sockaddr_un> address = AddressOf(socket);
  if (!address) {
    return Fault(false, "the path is too long for a Unix socket");
  }
  const Socket client(0);
  client.Limit(SO_SNDTIMEO, patience.connecting);
  if (client.Get() < 0 || !Connect(client.Get(), *address)) {
    return Fault(false, LastError());
  }
  client.Limit(SO_SNDTIMEO, patience.silence);
  client.Limit(SO_RCVTIMEO, patience.silence);
  while (!request.empty()) {
    const ssize_t count = send(client.Get(), request.data(), request.size(), MSG_NOSIGNAL);
    if (count < 0 && errno != EINTR) {
      // A server that refuses answers before it has read the whole request.
      const bool may_have_answered = errno == EPIPE || errno == ECONNRESET;
      const std::string why = LastError();
      const auto answer = may_have_answered ? ReadAnswer(client, patience, take)
                                            : tl::expected<int, ExchangeFault>(Fault(false, why));
      return answer ? answer : Fault(false, why);
    }
    request.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  }
  return ReadAnswer(client, patience, take);
}

bool Accepts(const std::filesystem::path& socket) {
  const std::optional<sockaddr_un> address = AddressOf(socket);
  // Does not wait: EAGAIN is a server that is there and has not come to this client yet.
  const Socket client(SOCK_NONBLOCK);
  return address && client.Get() >= 0 && (Connect(client.Get(), *address) || errno == EAGAIN);
}

}  // namespace sateen
