#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "scanner/daemon/api.h"
#include "scanner/daemon/http/access.h"
#include "scanner/daemon/http/connection.h"
#include "scanner/daemon/http/http_message.h"
#include "scanner/daemon/http/http_server.h"
#include "scanner/daemon/rig_service.h"

namespace sateen {

// State that all exchanges of a server share.
struct ExchangeContext {
  const Api& api;
  const RigService& service;
  const std::optional<AccessRules>& access;
  const HttpServerOptions& options;
  std::atomic<int>& streams;
  const std::atomic<bool>& stopping;
};

// Returns the headers of the request that decide whether it is let in.
[[nodiscard]] AccessHeaders AccessHeadersOf(const HttpRequest& request);

/// One request and its answer on one connection. Access is checked before the body is read.
class HttpExchange {
 public:
  // `begun` is what has been read of the request already.
  HttpExchange(Connection& connection, const ExchangeContext& context, std::string begun);
  void Run();

 private:
  // Returns nothing where the client goes, or is told that its head is not whole.
  [[nodiscard]] std::optional<std::string> ReadHead();
  [[nodiscard]] ApiResponse Answer(const HttpRequest& request);
  [[nodiscard]] tl::expected<std::string, ApiResponse> ReadBody(const HttpRequest& request);
  void Send(const ApiResponse& answer);
  void SendEvents(const ApiResponse::Events& events);

  Connection& connection_;
  const ExchangeContext& context_;
  std::string unread_;      // bytes that are not yet looked at
  bool head_only_ = false;  // asked with HEAD
};

}  // namespace sateen
