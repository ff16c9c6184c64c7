#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "scanner/daemon/access.h"
#include "scanner/daemon/api.h"
#include "scanner/daemon/connection.h"
#include "scanner/daemon/http_server.h"
#include "scanner/daemon/httplib.h"
#include "scanner/daemon/rig_service.h"

// One request and its answer on one connection. For .cc files only.
namespace sateen {

// What all exchanges of a server share.
struct ExchangeContext {
  const Api& api;
  const RigService& service;
  const std::optional<AccessRules>& access;
  const HttpServerOptions& options;
  std::atomic<int>& streams;
  const std::atomic<bool>& stopping;
};

// A server of cpp-httplib's that never listens: it lends its parser. Everything is answered before its
// routing, so that nothing of a request is matched with regular expressions, decompressed or split.
class HttpExchange : private httplib::Server {
 public:
  HttpExchange(Connection& connection, const ExchangeContext& context);
  void Run();

 private:
  [[nodiscard]] ApiResponse Answer(const httplib::Request& request);
  [[nodiscard]] tl::expected<std::string, ApiResponse> ReadBody(const httplib::Request& request);
  void Send(const ApiResponse& answer, httplib::Response& response);
  void SendEvents(const ApiResponse::Events& events, httplib::Response& response);

  Connection& connection_;
  const ExchangeContext& context_;
};

}  // namespace sateen
