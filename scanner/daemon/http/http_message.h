#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"

// HTTP/1.1 as bytes: Boost.Beast parses and writes it, and stays in the .cc file.
namespace sateen {

using HttpField = std::pair<std::string, std::string>;

/// Request line and header fields of one request.
struct HttpRequest {
  std::string method;
  std::string path;  // without query, percent-decoded
  std::vector<HttpField> fields;

  // Returns every value of the field; names match whatever their case.
  [[nodiscard]] std::vector<std::string> AllOf(std::string_view name) const;
  // Returns the first value of the field.
  [[nodiscard]] std::optional<std::string> FirstOf(std::string_view name) const;
};

/// Returns the number of bytes up to and including the empty line that ends a head; nothing while
/// it is missing. The first `searched` bytes are known not to hold all of it.
[[nodiscard]] std::optional<std::size_t> HeadSize(std::string_view bytes, std::size_t searched = 0);

/// Parses a whole head, up to and including its empty line.
///
/// Errors  kBadData: no HTTP/1.0 or 1.1 request; a field line that is folded, has no colon, or has
///         a space before its colon
[[nodiscard]] Result<HttpRequest> ParseRequest(std::string_view head);

/// Returns a request as a client sends it, with Content-Length and without keep-alive.
[[nodiscard]] std::string RequestText(std::string_view method, std::string_view target,
                                      const std::vector<HttpField>& fields, std::string_view body);

/// Returns status line and fields up to and including the empty line. Without `body_bytes` the body
/// comes in chunks.
[[nodiscard]] std::string ResponseHead(int status, const std::vector<HttpField>& fields,
                                       std::optional<std::size_t> body_bytes);

/// Returns a piece of a body that comes in chunks; an empty piece ends the body.
[[nodiscard]] std::string Chunk(std::string_view piece);

/// A response as it arrives, in pieces of any size.
class HttpResponseParser {
 public:
  HttpResponseParser();
  HttpResponseParser(const HttpResponseParser&) = delete;
  HttpResponseParser& operator=(const HttpResponseParser&) = delete;
  ~HttpResponseParser();

  // Fails with kBadData where the bytes are no HTTP response.
  [[nodiscard]] Status Add(std::string_view bytes);
  // Ends the bytes; fails with kBadData where the response is not whole.
  [[nodiscard]] Status End();

  // Returns the status; 0 while the head has not come.
  [[nodiscard]] int StatusCode() const;
  // Returns the bytes of the body that came since the last call.
  [[nodiscard]] std::string TakeBody();
  [[nodiscard]] bool Done() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sateen
