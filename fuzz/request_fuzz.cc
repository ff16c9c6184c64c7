// Any bytes go for a request to the daemon, from the socket to the API. No job begins, since the
// service has ended; what was asked is parsed all the same. Every request has an answer of HTTP.
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>

#include "fuzz/target.h"
#include "scanner/daemon/http/http_exchange.h"

namespace sateen::fuzz {
namespace {

// The daemon without a rig.
struct Daemon {
  RigService service{std::make_unique<RigDevices>(RigDeviceNames{})};
  Api api{service, {.version = "1.2.3"}};
  std::optional<AccessRules> access;
  HttpServerOptions options;
  std::atomic<int> streams = 0;
  std::atomic<bool> stopping = false;

  Daemon() { service.Stop(); }
};

std::string AnswerTo(Daemon& daemon, std::string_view request) {
  std::array<int, 2> ends = {};
  Need(socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) == 0);
  Need(fcntl(ends[1], F_SETFL, O_NONBLOCK) == 0);
  Need(send(ends[0], request.data(), request.size(), MSG_NOSIGNAL) ==
       static_cast<ssize_t>(request.size()));
  Need(shutdown(ends[0], SHUT_WR) == 0);
  {
    Connection connection(ends[1], {});
    HttpExchange(connection,
                 {daemon.api, daemon.service, daemon.access, daemon.options, daemon.streams,
                  daemon.stopping},
                 "")
        .Run();
  }
  close(ends[1]);
  std::string answer(4096, '\0');
  const ssize_t count = recv(ends[0], answer.data(), answer.size(), 0);
  answer.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  close(ends[0]);
  return answer;
}

}  // namespace

void Try(std::string_view bytes) {
  constexpr std::size_t kMostBytes = 100'000;  // which a socket takes at once
  static Daemon daemon;
  const std::string answer = AnswerTo(daemon, bytes.substr(0, kMostBytes));
  Need(answer.empty() || answer.starts_with("HTTP/1.1 "));
}

}  // namespace sateen::fuzz
