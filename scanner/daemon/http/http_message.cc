#include "scanner/daemon/http/http_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <cctype>
#include <charconv>
#include <limits>

namespace sateen {
namespace {

namespace http = boost::beast::http;

constexpr std::string_view kEndOfLine = "\r\n";
constexpr std::string_view kEndOfHead = "\r\n\r\n";

boost::beast::string_view Borrowed(std::string_view text) { return {text.data(), text.size()}; }

// Replaces %41 by A. A percent sign without two digits after it stays as it is.
std::string PercentDecoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char byte = 0;
    const char* const digits = text.data() + i + 1;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      decoded.push_back(static_cast<char>(byte));
      i += 2;
    } else {
      decoded.push_back(text[i]);
    }
  }
  return decoded;
}

bool SameName(std::string_view a, std::string_view b) {
  return boost::beast::iequals(Borrowed(a), Borrowed(b));
}

std::string FieldLines(const std::vector<HttpField>& fields) {
  std::string lines;
  for (const auto& [name, value] : fields) {
    lines += fmt::format("{}: {}\r\n", name, value);
  }
  return lines;
}

bool IsNameChar(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}

// Returns whether every field line is NAME:VALUE with no space before the colon (RFC 9112, 5.1).
// Readers differ in what they take "Origin :" for, and in where a folded line belongs.
bool HasPlainFieldLines(std::string_view head) {
  head.remove_suffix(kEndOfHead.size());
  for (std::size_t at = head.find(kEndOfLine); at != std::string_view::npos;) {
    const std::string_view rest = head.substr(at + kEndOfLine.size());
    const std::size_t next = rest.find(kEndOfLine);
    const std::string_view line = rest.substr(0, next);
    const std::string_view name = line.substr(0, line.find(':'));
    if (name.empty() || name.size() == line.size() || !std::ranges::all_of(name, IsNameChar)) {
      return false;
    }
    at = next == std::string_view::npos ? next : at + kEndOfLine.size() + next;
  }
  return true;
}

}  // namespace

std::vector<std::string> HttpRequest::AllOf(std::string_view name) const {
  std::vector<std::string> values;
  for (const auto& [key, value] : fields) {
    if (SameName(key, name)) {
      values.push_back(value);
    }
  }
  return values;
}

std::optional<std::string> HttpRequest::FirstOf(std::string_view name) const {
  const std::vector<std::string> values = AllOf(name);
  return values.empty() ? std::nullopt : std::optional(values.front());
}

std::optional<std::size_t> HeadSize(std::string_view bytes, std::size_t searched) {
  const std::size_t from = searched - std::min(searched, kEndOfHead.size() - 1);
  const std::size_t end = bytes.find(kEndOfHead, from);
  return end == std::string_view::npos ? std::nullopt : std::optional(end + kEndOfHead.size());
}

Result<HttpRequest> ParseRequest(std::string_view head) {
  if (!head.ends_with(kEndOfHead) || !HasPlainFieldLines(head)) {
    return Fail(ErrorCode::kBadData,
                "not an HTTP request: each line of its head must be NAME: VALUE, without a space "
                "before the colon");
  }
  http::request_parser<http::buffer_body> parser;                  // whose body is not read here
  parser.header_limit(std::numeric_limits<std::uint32_t>::max());  // the caller has its own
  parser.body_limit(std::numeric_limits<std::uint64_t>::max());
  boost::beast::error_code error;
  parser.put(boost::asio::buffer(head.data(), head.size()), error);
  if (error || !parser.is_header_done()) {
    return Fail(ErrorCode::kBadData, "not an HTTP request: {}",
                error ? error.message() : "its head has no end");
  }
  const auto& parsed = parser.get();
  if (parsed.method() == http::verb::unknown) {
    return Fail(ErrorCode::kBadData, "not an HTTP request: unknown method '{}'",
                std::string(parsed.method_string()));
  }
  const auto target = parsed.target();
  const std::string_view path(target.data(), std::min(target.find('?'), target.size()));
  HttpRequest request = {.method = std::string(parsed.method_string()),
                         .path = PercentDecoded(path)};
  for (const auto& field : parsed) {
    request.fields.emplace_back(field.name_string(), field.value());
  }
  return request;
}

std::string RequestText(std::string_view method, std::string_view target,
                        const std::vector<HttpField>& fields, std::string_view body) {
  return fmt::format("{} {} HTTP/1.1\r\n{}Content-Length: {}\r\nConnection: close\r\n\r\n{}",
                     method, target, FieldLines(fields), body.size(), body);
}

std::string ResponseHead(int status, const std::vector<HttpField>& fields,
                         std::optional<std::size_t> body_bytes) {
  const auto reason = http::obsolete_reason(http::int_to_status(static_cast<unsigned>(status)));
  return fmt::format("HTTP/1.1 {} {}\r\n{}{}\r\nConnection: close\r\n\r\n", status,
                     std::string_view(reason.data(), reason.size()), FieldLines(fields),
                     body_bytes ? fmt::format("Content-Length: {}", *body_bytes)
                                : std::string("Transfer-Encoding: chunked"));
}

std::string Chunk(std::string_view piece) {
  return fmt::format("{:x}\r\n{}\r\n", piece.size(), piece);
}

struct HttpResponseParser::Impl {
  http::response_parser<http::string_body> parser;
  std::string unread;  // bytes that the parser wants to see again with those that follow
};

HttpResponseParser::HttpResponseParser() : impl_(std::make_unique<Impl>()) {
  impl_->parser.eager(true);
  impl_->parser.body_limit(std::numeric_limits<std::uint64_t>::max());
}

HttpResponseParser::~HttpResponseParser() = default;

Status HttpResponseParser::Add(std::string_view bytes) {
  impl_->unread.append(bytes);
  std::string& unread = impl_->unread;
  while (!unread.empty() && !impl_->parser.is_done()) {
    boost::beast::error_code error;
    const std::size_t used =
        impl_->parser.put(boost::asio::buffer(unread.data(), unread.size()), error);
    unread.erase(0, used);
    if (error == http::error::need_more) {
      break;
    }
    if (error) {
      return Fail(ErrorCode::kBadData, "not an HTTP response: {}", error.message());
    }
  }
  return {};
}

Status HttpResponseParser::End() {
  boost::beast::error_code error;
  if (!impl_->parser.is_done()) {
    impl_->parser.put_eof(error);
  }
  return error ? Status(tl::unexpected(
                     Error{ErrorCode::kBadData,
                           fmt::format("the response is not whole: {}", error.message())}))
               : Status();
}

int HttpResponseParser::StatusCode() const {
  return impl_->parser.is_header_done() ? static_cast<int>(impl_->parser.get().result_int()) : 0;
}

std::string HttpResponseParser::TakeBody() {
  return std::exchange(impl_->parser.get().body(), std::string());
}

bool HttpResponseParser::Done() const { return impl_->parser.is_done(); }

}  // namespace sateen
