#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/daemon/api.h"

namespace sateen {

// Headers of a request that decide whether it is let in. An absent header has no values. A repeated
// header has all of its values.
struct AccessHeaders {
  std::vector<std::string> host;
  std::vector<std::string> authorization;
  bool has_origin = false;
};

/// Rules for access over TCP, where any program and any web page of this computer can knock. (On
/// the Unix socket the file's mode decides.)
///
///     Host     exactly one, localhost, 127.0.0.1 or [::1] with our port; else 421: a name that was
///              made to point to this computer is not ours
///     Origin   none; else 403: a web page asks
///     Authorization   exactly one, "Bearer <token>"; else 401. Compared in a time that does not
///              depend on where it differs
class AccessRules {
 public:
  AccessRules(std::string token, int port);

  // Returns the refusal, or nothing if the request is let in.
  [[nodiscard]] std::optional<ApiResponse> Check(const AccessHeaders& headers) const;

 private:
  std::string token_;
  int port_;
};

// Compares without looking at where they differ. Their lengths are no secret.
[[nodiscard]] bool SameInConstantTime(const std::string& a, const std::string& b);

/// Reads the token: the file's first line.
///
/// Errors  kIo: it cannot be read; kInvalidArgument: others than its owner may read or write it, it
///         is not the user's own, or the token is not of 16 to 512 printable characters without
///         spaces
[[nodiscard]] Result<std::string> ReadTokenFile(const std::filesystem::path& path);

}  // namespace sateen
