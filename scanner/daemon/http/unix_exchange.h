#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace sateen {

/// Reason why no whole answer came.
struct ExchangeFault {
  bool while_reading = false;  // the server took the request
  std::string why;
};

struct ExchangePatience {
  std::chrono::milliseconds connecting{5'000};
  std::chrono::milliseconds silence{120'000};  // between two pieces of the answer
};

/// Sends one HTTP request to the server on a Unix socket and gives the pieces of the answer's body,
/// with its status, to `take` as they come. Returns the status. A server that closes its end before
/// it has read the request may have answered: that answer counts.
[[nodiscard]] tl::expected<int, ExchangeFault> ExchangeOnUnixSocket(
    const std::filesystem::path& socket, std::string_view request, const ExchangePatience& patience,
    const std::function<void(int status, std::string_view piece)>& take);

/// Returns whether somebody accepts connections on the socket, and lets this user in.
[[nodiscard]] bool Accepts(const std::filesystem::path& socket);

}  // namespace sateen
