#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>

#include "core/error.h"
#include "scanner/daemon/api.h"
#include "scanner/daemon/http/access.h"
#include "scanner/daemon/http/listener.h"
#include "scanner/daemon/rig_service.h"

namespace sateen {

struct HttpServerOptions {
  // The whole request must have come within this time, and the client must take the answer's next
  // piece within it.
  std::chrono::milliseconds client_time{10'000};
  // How often a stream of events says that it is still there.
  std::chrono::milliseconds heartbeat{5000};
  std::size_t max_body_bytes = std::size_t{64} * 1024;
  int max_connections = 64;  // each has a thread; the next one is told 503
  int max_urgent = 4;        // threads beside them that only turn the lights off
  int max_streams = 16;      // connections among them that follow events
};

/// The API over HTTP/1.1 on one listener, one request per connection. Boost.Beast parses what
/// comes; sockets, deadlines and limits are here.
///
/// 400 no HTTP or no valid Content-Length, 401, 403, 421 (AccessRules), 408 too slow, 411 a body
/// without Content-Length, 413 too long a body, 414 too long a path, 415 a body that is no
/// application/json, 503 too many clients; everything else is the Api's answer.
///
/// A client that turns the lights off is served whatever the others do: a connection for which
/// there is no thread is asked first what it wants (WaitingRoom).
class HttpServer {
 public:
  // Lets in everybody who can connect if there is no `access`. `api` and `service` must outlive the
  // server.
  HttpServer(Listener listener, const Api& api, const RigService& service,
             std::optional<AccessRules> access, const HttpServerOptions& options = {});
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;
  // Takes no more connections and reads no more of those that are open, gives answers that are
  // under way a moment, and ends them.
  ~HttpServer();

  [[nodiscard]] const Listener& GetListener() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sateen
