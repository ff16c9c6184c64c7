#include "scanner/daemon/http_exchange.h"

#include <algorithm>
#include <charconv>
#include <memory>
#include <utility>
#include <vector>

namespace sateen {
namespace {

constexpr const char* kJson = "application/json";

std::vector<std::string> AllOf(const httplib::Request& request, const char* key) {
  std::vector<std::string> values;
  const auto [begin, end] = request.headers.equal_range(key);
  std::transform(begin, end, std::back_inserter(values), [](const auto& h) { return h.second; });
  return values;
}

template <typename T>
std::optional<T> Digits(const std::string& text) {
  T number = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && rest == text.data() + text.size() ? std::optional(number)
                                                                   : std::nullopt;
}

ApiResponse RefusedBody(int status, std::string message) {
  return Refused(status, {ErrorCode::kInvalidArgument, std::move(message)});
}

// One event as server-sent events have it.
std::string EventText(const JobEvent& event) {
  return fmt::format("id: {}\nevent: {}\ndata: {}\n\n", event.sequence, event.type, event.data);
}

// What the parser refuses by itself has no body yet.
httplib::Server::HandlerResponse FillRefusal(const httplib::Request& /*request*/,
                                             httplib::Response& response) {
  if (!response.body.empty()) {
    return httplib::Server::HandlerResponse::Unhandled;
  }
  const ApiResponse refused = RefusedBody(
      response.status,
      "this is no HTTP/1.1 request that the daemon understands; docs/api.md shows some");
  response.set_content(refused.body + "\n", kJson);
  return httplib::Server::HandlerResponse::Handled;
}

// Counts a stream for as long as it lives.
class StreamSlot {
 public:
  explicit StreamSlot(std::atomic<int>& streams) : streams_(streams) { ++streams_; }
  StreamSlot(const StreamSlot&) = delete;
  StreamSlot& operator=(const StreamSlot&) = delete;
  ~StreamSlot() { --streams_; }

 private:
  std::atomic<int>& streams_;
};

}  // namespace

HttpExchange::HttpExchange(Connection& connection, const ExchangeContext& context)
    : connection_(connection), context_(context) {
  svr_sock_ = connection.socket();  // or its streams end at once
  set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
    Send(Answer(request), response);
    return HandlerResponse::Handled;
  });
  set_error_handler(HandlerWithResponse(FillRefusal));
}

void HttpExchange::Run() {
  bool closed = false;
  process_request(connection_, /*close_connection=*/true, closed, [](httplib::Request& request) {
    // cpp-httplib would cut or compress answers as these ask.
    request.ranges.clear();
    request.headers.erase("Accept-Encoding");
  });
}

ApiResponse HttpExchange::Answer(const httplib::Request& request) {
  if (context_.access) {
    const AccessHeaders headers = {.host = AllOf(request, "Host"),
                                   .authorization = AllOf(request, "Authorization"),
                                   .has_origin = request.has_header("Origin")};
    if (std::optional<ApiResponse> refused = context_.access->Check(headers)) {
      return *std::move(refused);
    }
  }
  tl::expected<std::string, ApiResponse> body = ReadBody(request);
  if (!body) {
    return std::move(body.error());
  }
  ApiRequest asked = {.method = request.method,
                      .path = request.path,
                      .body = *std::move(body),
                      .who = connection_.PeerName()};
  if (request.has_header("Last-Event-ID")) {
    asked.last_event_id = Digits<std::uint64_t>(request.get_header_value("Last-Event-ID"));
    if (!asked.last_event_id) {
      return RefusedBody(400, fmt::format("Last-Event-ID is '{}'; need the number of an event",
                                          request.get_header_value("Last-Event-ID")));
    }
  }
  return context_.api.Handle(asked);
}

tl::expected<std::string, ApiResponse> HttpExchange::ReadBody(const httplib::Request& request) {
  const auto refuse = [](int status, std::string message) {
    return tl::unexpected<ApiResponse>(RefusedBody(status, std::move(message)));
  };
  const std::vector<std::string> lengths = AllOf(request, "Content-Length");
  if (request.has_header("Transfer-Encoding") || request.has_header("Content-Encoding")) {
    return refuse(411, "the body is encoded; need it as it is, with a Content-Length");
  }
  if (lengths.empty()) {
    return {};
  }
  const std::optional<std::uint64_t> length =
      lengths.size() == 1 ? Digits<std::uint64_t>(lengths.front()) : std::nullopt;
  if (!length) {
    return refuse(400, fmt::format("Content-Length is '{}'; need one number of bytes",
                                   fmt::join(lengths, ", ")));
  }
  if (*length > context_.options.max_body_bytes) {
    return refuse(413, fmt::format("the body has {} bytes; need at most {}", *length,
                                   context_.options.max_body_bytes));
  }
  if (*length > 0 && !request.get_header_value("Content-Type").starts_with(kJson)) {
    return refuse(415, fmt::format("Content-Type is '{}'; need {}",
                                   request.get_header_value("Content-Type"), kJson));
  }
  std::string body(*length, '\0');
  for (std::size_t got = 0; got < body.size();) {
    const ssize_t count = connection_.read(body.data() + got, body.size() - got);
    if (count <= 0) {
      return refuse(408, fmt::format("{} of {} bytes of the body came in time", got, body.size()));
    }
    got += static_cast<std::size_t>(count);
  }
  return body;
}

void HttpExchange::Send(const ApiResponse& answer, httplib::Response& response) {
  response.status = answer.status;
  response.set_header("Cache-Control", "no-store");
  response.set_header("X-Content-Type-Options", "nosniff");
  if (!answer.allow.empty()) {
    response.set_header("Allow", answer.allow);
  }
  if (answer.status == 401) {
    response.set_header("WWW-Authenticate", "Bearer");
  }
  if (!answer.events) {
    response.set_content(answer.content_type == kJson ? answer.body + "\n" : answer.body,
                         answer.content_type);
    return;
  }
  if (context_.streams >= context_.options.max_streams) {
    const ApiResponse refused = Refused(
        503, {ErrorCode::kDevice, "too many clients follow events; wait until one has ended"});
    response.status = refused.status;
    response.set_content(refused.body + "\n", kJson);
    return;
  }
  SendEvents(*answer.events, response);
}

void HttpExchange::SendEvents(const ApiResponse::Events& events, httplib::Response& response) {
  const auto slot = std::make_shared<StreamSlot>(context_.streams);
  response.set_chunked_content_provider(
      "text/event-stream", [this, slot, id = events.job, after = events.after, first = true](
                               size_t /*offset*/, httplib::DataSink& sink) mutable {
        const std::optional<FollowedEvents> followed = context_.service.Follow(
            id, after, first ? std::chrono::milliseconds(0) : context_.options.heartbeat);
        std::string text = !followed || followed->events.empty() ? ":\n\n" : "";
        first = false;
        for (const JobEvent& event : followed ? followed->events : std::vector<JobEvent>()) {
          text += EventText(event);
          after = event.sequence;
        }
        if (!connection_.is_writable() || !sink.write(text.data(), text.size())) {
          return false;
        }
        if (!followed || followed->ended || context_.stopping) {
          sink.done();
        }
        return true;
      });
}

}  // namespace sateen
