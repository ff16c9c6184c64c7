#include "scanner/daemon/http/listener.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "core/files/file_io.h"

namespace sateen {
namespace {

constexpr int kBacklog = 64;

sockaddr* Generic(void* address) { return static_cast<sockaddr*>(address); }

// Returns whether somebody answers at the socket. If so, it was not left behind.
bool IsAlive(sockaddr_un& address) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const bool connected =
      fd >= 0 && (connect(fd, Generic(&address), sizeof address) == 0 || errno == EAGAIN);
  if (fd >= 0) {
    close(fd);
  }
  return connected;
}

Status InUse(const std::filesystem::path& path) {
  return Fail(ErrorCode::kDevice,
              "a daemon is running at {}; use it, or end it first ('fuser {}' tells which it is)",
              path.string(), path.string());
}

// Fails unless the lock is a regular file of this user.
Status CheckLock(int fd, const std::filesystem::path& path) {
  struct stat file = {};
  const bool ours = fstat(fd, &file) == 0 && S_ISREG(file.st_mode) && file.st_uid == geteuid();
  return ours ? Status{}
              : Fail(ErrorCode::kIo,
                     "{}.lock: is not a regular file of this user; remove it, or name a socket "
                     "elsewhere: --socket",
                     path.string());
}

// Makes room for the socket: nothing is there, or what a daemon left that was killed.
Status RemoveStale(const std::filesystem::path& path, sockaddr_un& address) {
  struct stat there = {};
  if (lstat(path.c_str(), &there) != 0) {
    return errno == ENOENT ? Status{}
                           : Fail(ErrorCode::kIo, "{}: {}", path.string(), SystemReason(errno));
  }
  if (!S_ISSOCK(there.st_mode)) {
    return Fail(ErrorCode::kIo, "{}: is there and no socket; remove it, or name another: --socket",
                path.string());
  }
  if (IsAlive(address)) {
    return InUse(path);
  }
  return unlink(path.c_str()) == 0 ? Status{}
                                   : Fail(ErrorCode::kIo, "{}: cannot be replaced: {}",
                                          path.string(), SystemReason(errno));
}

// Binds the socket so that its file has mode 0600 from its first moment.
Status BindPrivately(int fd, sockaddr_un& address) {
  const mode_t mask = umask(0177);
  const bool bound = bind(fd, Generic(&address), sizeof address) == 0;
  const int reason = errno;
  umask(mask);
  if (!bound || listen(fd, kBacklog) != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot listen: {}", address.sun_path,
                SystemReason(bound ? errno : reason));
  }
  return {};
}

struct LoopbackAddress {
  bool v6 = false;
  std::uint16_t port = 0;
};

Result<LoopbackAddress> ParseLoopback(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const std::string host = text.substr(0, colon);
  LoopbackAddress address = {.v6 = host == "[::1]"};
  const bool ours = address.v6 || host == "127.0.0.1" || host == "localhost";
  const char* const end = text.data() + text.size();
  const char* const digits = colon == std::string::npos ? end : text.data() + colon + 1;
  const auto [rest, error] = std::from_chars(digits, end, address.port);
  if (!ours || error != std::errc() || rest != end) {
    return Fail(ErrorCode::kInvalidArgument,
                "'{}' is no address to listen on; need 127.0.0.1:PORT or [::1]:PORT: the daemon is "
                "for this computer alone",
                text);
  }
  return address;
}

}  // namespace

Result<Listener> Listener::OnUnixSocket(const std::filesystem::path& path) {
  sockaddr_un address = {.sun_family = AF_UNIX};
  if (path.empty() || path.native().size() >= sizeof address.sun_path) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: has {} bytes; a socket's path has 1 to {}: name a shorter one with --socket",
                path.string(), path.native().size(), sizeof address.sun_path - 1);
  }
  std::memcpy(address.sun_path, path.c_str(), path.native().size() + 1);
  Listener listener;
  // A link in its place could make this create, or lock, a file of somebody else.
  listener.lock_ = open((path.native() + ".lock").c_str(),
                        O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
  if (listener.lock_ < 0) {
    const int reason = errno;
    return Fail(
        ErrorCode::kIo, "{}.lock: cannot be made: {}{}", path.string(), SystemReason(reason),
        reason == ENOENT
            ? fmt::format("; make the folder first: mkdir -p {}, or name a socket elsewhere: "
                          "--socket",
                          path.parent_path().string())
        : reason == ELOOP ? "; it is a link: remove it, or name a socket elsewhere: --socket"
                          : "; name a socket elsewhere: --socket");
  }
  Status status = CheckLock(listener.lock_, path);
  if (status) {
    status =
        flock(listener.lock_, LOCK_EX | LOCK_NB) == 0 ? RemoveStale(path, address) : InUse(path);
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  listener.fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  status = listener.fd_ < 0 ? Fail(ErrorCode::kIo, "no socket: {}", SystemReason(errno))
                            : BindPrivately(listener.fd_, address);
  if (!status) {
    return tl::unexpected(status.error());
  }
  listener.path_ = path;
  listener.name_ = "unix:" + path.string();
  return listener;
}

Result<Listener> Listener::OnLoopback(const std::string& text) {
  const Result<LoopbackAddress> parsed = ParseLoopback(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  sockaddr_in v4 = {.sin_family = AF_INET, .sin_port = htons(parsed->port)};
  v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  sockaddr_in6 v6 = {.sin6_family = AF_INET6, .sin6_port = htons(parsed->port)};
  v6.sin6_addr = in6addr_loopback;
  sockaddr* const address = parsed->v6 ? Generic(&v6) : Generic(&v4);
  socklen_t size = parsed->v6 ? sizeof v6 : sizeof v4;
  Listener listener;
  listener.fd_ = socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int on = 1;
  if (listener.fd_ < 0 || setsockopt(listener.fd_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      bind(listener.fd_, address, size) != 0 || listen(listener.fd_, kBacklog) != 0 ||
      getsockname(listener.fd_, address, &size) != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot listen: {}; name another port", text,
                SystemReason(errno));
  }
  listener.port_ = ntohs(parsed->v6 ? v6.sin6_port : v4.sin_port);
  listener.name_ = fmt::format("http://{}:{}", parsed->v6 ? "[::1]" : "127.0.0.1", listener.port_);
  return listener;
}

Listener::Listener(Listener&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      lock_(std::exchange(other.lock_, -1)),
      port_(other.port_),
      path_(std::exchange(other.path_, {})),
      name_(std::move(other.name_)) {}

Listener::~Listener() {
  if (!path_.empty()) {
    unlink(path_.c_str());  // before the lock goes: until then nobody else's can be there
  }
  for (const int fd : {fd_, lock_}) {
    if (fd >= 0) {
      close(fd);
    }
  }
}

std::filesystem::path DefaultSocketPath() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing in this program sets variables
  const char* const folder = std::getenv("XDG_RUNTIME_DIR");
  return folder != nullptr && *folder != '\0' ? std::filesystem::path(folder) / "sateen.sock"
                                              : "/run/sateen/sateen.sock";
}

}  // namespace sateen
