#include "scanner/daemon/http/http_exchange.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <utility>
#include <vector>

namespace sateen {
namespace {

constexpr std::size_t kMaxHead = 65'536;  // bytes
constexpr std::size_t kMaxTarget = 8192;  // bytes
constexpr const char* kJson = "application/json";

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

// Writes one event in the form of server-sent events.
std::string EventText(const JobEvent& event) {
  return fmt::format("id: {}\nevent: {}\ndata: {}\n\n", event.sequence, event.type, event.data);
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

AccessHeaders AccessHeadersOf(const HttpRequest& request) {
  return {.host = request.AllOf("Host"),
          .authorization = request.AllOf("Authorization"),
          .has_origin = request.FirstOf("Origin").has_value()};
}

HttpExchange::HttpExchange(Connection& connection, const ExchangeContext& context,
                           std::string begun)
    : connection_(connection), context_(context), unread_(std::move(begun)) {}

std::optional<std::string> HttpExchange::ReadHead() {
  std::string bytes = std::exchange(unread_, std::string());
  std::size_t searched = 0;
  std::optional<std::size_t> size;
  while (!(size = HeadSize(bytes, searched)) && bytes.size() < kMaxHead) {
    searched = bytes.size();
    const Heard heard = connection_.Read(bytes);
    if (heard == Heard::kBytes) {
      continue;
    }
    if (context_.stopping) {
      Send(Refused(503, {ErrorCode::kDevice, "the daemon is ending; start it again"}));
    } else if (heard == Heard::kLate) {
      Send(RefusedBody(
          408, fmt::format("the request did not come within {:g} s",
                           std::chrono::duration<double>(context_.options.client_time).count())));
    } else if (!bytes.empty()) {
      Send(RefusedBody(400, "the request ends before the empty line that ends its head"));
    }
    return std::nullopt;
  }
  if (!size) {
    Send(RefusedBody(400, fmt::format("the head has more than {} bytes", kMaxHead)));
    return std::nullopt;
  }
  unread_ = bytes.substr(*size);
  bytes.resize(*size);
  return bytes;
}

void HttpExchange::Run() {
  const std::optional<std::string> head = ReadHead();
  if (!head) {
    return;
  }
  const Result<HttpRequest> request = ParseRequest(*head);
  if (!request) {
    Send(RefusedBody(400, request.error().message + "; docs/api.md has examples"));
    return;
  }
  head_only_ = request->method == "HEAD";
  Send(Answer(*request));
}

ApiResponse HttpExchange::Answer(const HttpRequest& request) {
  if (request.path.size() > kMaxTarget) {
    return RefusedBody(414, fmt::format("the path has {} bytes; need at most {}",
                                        request.path.size(), kMaxTarget));
  }
  if (context_.access) {
    if (std::optional<ApiResponse> refused = context_.access->Check(AccessHeadersOf(request))) {
      return *std::move(refused);
    }
  }
  // Turning the lights off does not wait for a body.
  tl::expected<std::string, ApiResponse> body =
      IsLightsOff(request.method, request.path) ? std::string() : ReadBody(request);
  if (!body) {
    return std::move(body.error());
  }
  ApiRequest asked = {.method = request.method,
                      .path = request.path,
                      .body = *std::move(body),
                      .who = connection_.PeerName(),
                      .client_left = [&] { return context_.stopping || connection_.HasLeft(); }};
  if (const std::optional<std::string> last = request.FirstOf("Last-Event-ID")) {
    asked.last_event_id = Digits<std::uint64_t>(*last);
    if (!asked.last_event_id) {
      return RefusedBody(400,
                         fmt::format("Last-Event-ID is '{}'; need the number of an event", *last));
    }
  }
  return context_.api.Handle(asked);
}

tl::expected<std::string, ApiResponse> HttpExchange::ReadBody(const HttpRequest& request) {
  const auto refuse = [](int status, std::string message) {
    return tl::unexpected<ApiResponse>(RefusedBody(status, std::move(message)));
  };
  const std::vector<std::string> lengths = request.AllOf("Content-Length");
  if (request.FirstOf("Transfer-Encoding") || request.FirstOf("Content-Encoding")) {
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
  const std::string type = request.FirstOf("Content-Type").value_or("");
  if (*length > 0 && !type.starts_with(kJson)) {
    return refuse(415, fmt::format("Content-Type is '{}'; need {}", type, kJson));
  }
  if (request.FirstOf("Expect") == "100-continue" && unread_.empty() &&
      !connection_.Write("HTTP/1.1 100 Continue\r\n\r\n")) {
    return refuse(408, "the client is gone");
  }
  std::string body = std::move(unread_);
  while (body.size() < *length) {
    const Heard heard = connection_.Read(body);
    if (heard != Heard::kBytes) {
      return refuse(heard == Heard::kLate ? 408 : 400,
                    fmt::format("{} of {} bytes of the body came{}", body.size(), *length,
                                heard == Heard::kLate ? " in time" : "; need all of them"));
    }
  }
  body.resize(*length);
  return body;
}

void HttpExchange::Send(const ApiResponse& answer) {
  if (answer.events && context_.streams >= context_.options.max_streams) {
    Send(Refused(503,
                 {ErrorCode::kDevice, "too many clients follow events; wait until one has ended"}));
    return;
  }
  std::vector<HttpField> fields = {{"Cache-Control", "no-store"},
                                   {"X-Content-Type-Options", "nosniff"}};
  if (!answer.allow.empty()) {
    fields.emplace_back("Allow", answer.allow);
  }
  if (answer.status == 401) {
    fields.emplace_back("WWW-Authenticate", "Bearer");
  }
  if (answer.events) {
    fields.emplace_back("Content-Type", "text/event-stream");
    if (connection_.Write(ResponseHead(answer.status, fields, std::nullopt)) && !head_only_) {
      SendEvents(*answer.events);
    }
    return;
  }
  const std::string body = answer.content_type == kJson ? answer.body + "\n" : answer.body;
  fields.emplace_back("Content-Type", answer.content_type);
  const std::string head = ResponseHead(answer.status, fields, body.size());
  // A client that has gone gets no answer.
  [[maybe_unused]] const bool sent = connection_.Write(head_only_ ? head : head + body);
}

void HttpExchange::SendEvents(const ApiResponse::Events& events) {
  using std::chrono::steady_clock;
  const StreamSlot slot(context_.streams);
  std::uint64_t after = events.after;
  auto wait = std::chrono::milliseconds(0);
  auto next_sign = steady_clock::now();  // when the client must hear that the stream is there
  for (bool ended = false; !ended; wait = std::min(context_.options.heartbeat, kLookForClient)) {
    const std::optional<FollowedEvents> followed = context_.service.Follow(events.job, after, wait);
    ended = !followed || followed->ended || context_.stopping;
    std::string text;
    for (const JobEvent& event : followed ? followed->events : std::vector<JobEvent>()) {
      text += EventText(event);
      after = event.sequence;
    }
    if (text.empty() && steady_clock::now() >= next_sign) {
      text = ":\n\n";
    }
    if ((connection_.HasLeft() && !context_.stopping) ||
        (!text.empty() && !connection_.Write(Chunk(text)))) {
      return;
    }
    next_sign = text.empty() ? next_sign : steady_clock::now() + context_.options.heartbeat;
  }
  [[maybe_unused]] const bool sent = connection_.Write(Chunk(""));
}

}  // namespace sateen
