#include "scanner/daemon/http/http_server.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <list>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/check.h"
#include "scanner/daemon/http/http_exchange.h"
#include "scanner/daemon/http/waiting_room.h"

namespace sateen {
namespace {

// For answers that are under way when the server ends. Requests that are still being read are not
// waited for.
constexpr std::chrono::milliseconds kGrace{300};
// How long a client that turned the lights off keeps others from it: its request has been read.
constexpr std::chrono::milliseconds kUrgentDrain{20};
// Connections that are accepted before those in the waiting room are looked at again.
constexpr int kAcceptAtOnce = 16;
// When the system has no descriptors or memory left, until there are some again.
constexpr std::chrono::milliseconds kPause{20};

std::string TooManyText(int most) {
  const std::string body =
      Refused(503, {ErrorCode::kDevice,
                    fmt::format("the daemon has too many clients: it serves {} at a time; try "
                                "again later (lights/off is served at once)",
                                most)})
          .body +
      "\n";
  return ResponseHead(503, {{"Content-Type", "application/json"}, {"Cache-Control", "no-store"}},
                      body.size()) +
         body;
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
        wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        room_(TooManyText(options.max_connections),
              [this](std::string_view head) { return TurnsLightsOff(head); }) {
    SATEEN_CHECK(wake_ >= 0);
    acceptor_ = std::thread([this] { Accept(); });
  }

  ~Impl() {
    stopping_ = true;
    eventfd_write(wake_, 1);
    acceptor_.join();
    {
      std::unique_lock lock(mutex_);
      ShutDown(SHUT_RD);
      ended_.wait_for(lock, kGrace, [&] { return OpenCount(false) + OpenCount(true) == 0; });
      ShutDown(SHUT_RDWR);
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
    bool urgent = false;  // turns the lights off, in a thread that is kept for that
    bool ended = false;   // with the mutex held
    std::thread thread;
  };

  // Both with the mutex held.
  [[nodiscard]] int OpenCount(bool urgent) const {
    return static_cast<int>(std::ranges::count_if(
        clients_, [&](const Client& c) { return !c.ended && c.urgent == urgent; }));
  }
  void ShutDown(int how) const {
    for (const Client& client : clients_) {
      if (!client.ended) {
        shutdown(client.fd, how);
      }
    }
  }

  [[nodiscard]] bool TurnsLightsOff(std::string_view head) const {
    const Result<HttpRequest> request = ParseRequest(head);
    return request && IsLightsOff(request->method, request->path) &&
           !(access_ && access_->Check(AccessHeadersOf(*request)));
  }

  void Accept() {
    while (!stopping_) {
      try {
        AcceptAndServe();
      } catch (const std::exception&) {
        std::this_thread::sleep_for(kPause);  // out of memory
      }
    }
  }

  // Waits for the next thing that happens.
  void AcceptAndServe() {
    std::vector<pollfd> entries = {{.fd = listener_.Descriptor(), .events = POLLIN, .revents = 0},
                                   {.fd = wake_, .events = POLLIN, .revents = 0}};
    room_.AppendTo(entries);
    poll(entries.data(), entries.size(), room_.WaitMs());
    eventfd_t ended = 0;
    eventfd_read(wake_, &ended);
    JoinEnded();
    room_.Serve();
    for (auto urgent = room_.TakeUrgent(); urgent; urgent = room_.TakeUrgent()) {
      if (!Begin(urgent->fd, /*urgent=*/true, urgent->begun)) {
        room_.AddUrgent(*std::move(urgent));
        break;
      }
    }
    for (int i = 0; i < kAcceptAtOnce && AcceptOne(); ++i) {
    }
  }

  // Returns false where nobody has come.
  bool AcceptOne() {
    const int fd = accept4(listener_.Descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
      if (errno != EAGAIN && errno != EINTR) {
        std::this_thread::sleep_for(kPause);
      }
      return false;
    }
    if (!Begin(fd, /*urgent=*/false, "")) {
      room_.Add(fd);
    }
    return true;
  }

  void JoinEnded() {
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
    }
    for (Client& client : over) {
      client.thread.join();
    }
  }

  // Returns false where there is no thread for it; the descriptor is then still the caller's.
  bool Begin(int fd, bool urgent, const std::string& begun) {
    const std::lock_guard lock(mutex_);
    if (OpenCount(urgent) >= (urgent ? options_.max_urgent : options_.max_connections)) {
      return false;
    }
    Client& client = clients_.emplace_back();
    client.fd = fd;
    client.urgent = urgent;
    try {
      client.thread = std::thread([this, &client, begun] { Serve(client, begun); });
    } catch (const std::system_error&) {  // no more threads
      clients_.pop_back();
      return false;
    }
    return true;
  }

  void Serve(Client& client, const std::string& begun) {
    ConnectionLimits limits = {.read = options_.client_time, .write = options_.client_time};
    if (client.urgent) {
      limits.drain = kUrgentDrain;
    }
    try {
      Connection connection(client.fd, limits);
      HttpExchange(connection, context_, begun).Run();
    } catch (const std::exception&) {
      // Out of memory or threads: this client goes without an answer, the daemon stays.
    }
    const std::lock_guard lock(mutex_);
    close(client.fd);
    client.ended = true;
    ended_.notify_all();
    eventfd_write(wake_, 1);
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
  WaitingRoom room_;  // used by the acceptor alone
  std::thread acceptor_;
};

HttpServer::HttpServer(Listener listener, const Api& api, const RigService& service,
                       std::optional<AccessRules> access, const HttpServerOptions& options)
    : impl_(std::make_unique<Impl>(std::move(listener), api, service, std::move(access), options)) {
}

HttpServer::~HttpServer() = default;

const Listener& HttpServer::GetListener() const { return impl_->GetListener(); }

}  // namespace sateen
