#include "scanner/daemon/http_server.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <list>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "core/check.h"
#include "scanner/daemon/http_exchange.h"

namespace sateen {
namespace {

constexpr std::chrono::seconds kGrace{1};
// When the system has no descriptors or memory left, until there are some again.
constexpr std::chrono::milliseconds kPause{20};

void RefuseBusy(int fd) {
  const std::string body =
      Refused(503, {ErrorCode::kDevice, "the daemon has too many clients; try again later"}).body;
  const std::string answer = fmt::format(
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nContent-Length: {}\r\n"
      "Connection: close\r\n\r\n{}",
      body.size(), body);
  std::array<char, 4096> unread = {};  // unread bytes would make the client lose the answer
  [[maybe_unused]] ssize_t ignored = recv(fd, unread.data(), unread.size(), MSG_DONTWAIT);
  ignored = send(fd, answer.data(), answer.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  close(fd);
}

}  // namespace

class HttpServer::Impl {
 public:
  Impl(Listener listener, const Api& api, const RigService& service,
       std::optional<AccessRules> access, const HttpServerOptions& options)
      : listener_(std::move(listener)),
        access_(std::move(access)),
        options_(options),
        context_{.api = api,
                 .service = service,
                 .access = access_,
                 .options = options_,
                 .streams = streams_,
                 .stopping = stopping_},
        wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    SATEEN_CHECK(wake_ >= 0);
    acceptor_ = std::thread([this] { Accept(); });
  }

  ~Impl() {
    stopping_ = true;
    eventfd_write(wake_, 1);
    acceptor_.join();
    {
      std::unique_lock lock(mutex_);
      ended_.wait_for(lock, kGrace, [&] { return OpenCount() == 0; });
      for (const Client& client : clients_) {
        if (!client.ended) {
          shutdown(client.fd, SHUT_RDWR);
        }
      }
    }
    for (Client& client : clients_) {
      client.thread.join();
    }
    close(wake_);
  }

  [[nodiscard]] const Listener& GetListener() const { return listener_; }

 private:
  struct Client {
    int fd = -1;
    bool ended = false;  // with the mutex held
    std::thread thread;
  };

  [[nodiscard]] int OpenCount() const {
    return static_cast<int>(
        std::count_if(clients_.begin(), clients_.end(), [](const auto& c) { return !c.ended; }));
  }

  void Accept() {
    std::array<pollfd, 2> entries = {
        {{.fd = listener_.Descriptor(), .events = POLLIN}, {.fd = wake_, .events = POLLIN}}};
    while (!stopping_) {
      if (poll(entries.data(), entries.size(), -1) < 0 || (entries[0].revents & POLLIN) == 0) {
        continue;
      }
      const int fd =
          accept4(listener_.Descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (fd >= 0) {
        Begin(fd);
      } else if (errno != EAGAIN && errno != EINTR) {
        std::this_thread::sleep_for(kPause);
      }
    }
  }

  void Begin(int fd) {
    std::list<Client> over;
    {
      const std::lock_guard lock(mutex_);
      for (auto client = clients_.begin(); client != clients_.end();) {
        const auto next = std::next(client);
        if (client->ended) {
          over.splice(over.end(), clients_, client);
        }
        client = next;
      }
      if (OpenCount() < options_.max_connections) {
        Client& client = clients_.emplace_back();
        client.fd = std::exchange(fd, -1);
        try {
          client.thread = std::thread([this, &client] { Serve(client); });
        } catch (const std::system_error&) {  // no more threads
          fd = client.fd;
          clients_.pop_back();
        }
      }
    }
    if (fd >= 0) {
      RefuseBusy(fd);
    }
    for (Client& client : over) {
      client.thread.join();
    }
  }

  void Serve(Client& client) {
    const ConnectionLimits limits = {.read = options_.client_time, .write = options_.client_time};
    try {
      Connection connection(client.fd, limits);
      HttpExchange(connection, context_).Run();
    } catch (const std::exception&) {
      // Out of memory or threads: this client goes without an answer, the daemon stays.
    }
    const std::lock_guard lock(mutex_);
    close(client.fd);
    client.ended = true;
    ended_.notify_all();
  }

  Listener listener_;
  const std::optional<AccessRules> access_;
  const HttpServerOptions options_;
  std::atomic<int> streams_ = 0;
  std::atomic<bool> stopping_ = false;
  const ExchangeContext context_;
  const int wake_;
  std::mutex mutex_;  // for the clients
  std::condition_variable ended_;
  std::list<Client> clients_;
  std::thread acceptor_;
};

HttpServer::HttpServer(Listener listener, const Api& api, const RigService& service,
                       std::optional<AccessRules> access, const HttpServerOptions& options)
    : impl_(std::make_unique<Impl>(std::move(listener), api, service, std::move(access), options)) {
}

HttpServer::~HttpServer() = default;

const Listener& HttpServer::GetListener() const { return impl_->GetListener(); }

}  // namespace sateen
