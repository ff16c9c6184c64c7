#include "scanner/daemon/http/access.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <utility>

#include "core/files/file_io.h"

namespace sateen {
namespace {

constexpr std::string_view kBearer = "Bearer ";

std::string LowerCase(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

}  // namespace

bool SameInConstantTime(const std::string& a, const std::string& b) {
  if (a.size() != b.size()) {
    return false;
  }
  unsigned char differs = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    differs = static_cast<unsigned char>(
        differs | (static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i])));
  }
  return differs == 0;
}

AccessRules::AccessRules(std::string token, int port) : token_(std::move(token)), port_(port) {}

std::optional<ApiResponse> AccessRules::Check(const AccessHeaders& headers) const {
  const std::string host = headers.host.size() == 1 ? LowerCase(headers.host.front()) : "";
  const std::array<std::string, 3> ours = {fmt::format("localhost:{}", port_),
                                           fmt::format("127.0.0.1:{}", port_),
                                           fmt::format("[::1]:{}", port_)};
  if (std::ranges::find(ours, host) == ours.end()) {
    return Refused(
        421, {ErrorCode::kInvalidArgument, fmt::format("the Host header is '{}'; need {}, {} or {}",
                                                       host, ours[0], ours[1], ours[2])});
  }
  if (headers.has_origin) {
    return Refused(403, {ErrorCode::kInvalidArgument,
                         "the request has an Origin header, so a web page sent it; the daemon is "
                         "for programs of this computer"});
  }
  const std::string given =
      headers.authorization.size() == 1 ? headers.authorization.front() : std::string();
  if (!given.starts_with(kBearer) || !SameInConstantTime(given.substr(kBearer.size()), token_)) {
    return Refused(401, {ErrorCode::kInvalidArgument,
                         "the Authorization header is missing or wrong; need 'Bearer' and the "
                         "token of the file that the daemon was started with"});
  }
  return std::nullopt;
}

Result<std::string> ReadTokenFile(const std::filesystem::path& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) {
    return Fail(ErrorCode::kIo, "{}: cannot read the token: {}", path.string(),
                SystemReason(errno));
  }
  struct stat status = {};
  std::array<char, 1024> bytes = {};
  const bool known = fstat(fd, &status) == 0;
  const ssize_t count =
      known && S_ISREG(status.st_mode) ? read(fd, bytes.data(), bytes.size()) : -1;
  close(fd);
  if (count < 0) {
    return Fail(ErrorCode::kIo, "{}: cannot read the token: need a regular file", path.string());
  }
  if ((status.st_mode & 0077U) != 0 || status.st_uid != geteuid()) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: has mode {:04o} and owner {}; a token is for its owner alone: chmod 600 and "
                "chown it to you",
                path.string(), status.st_mode & 07777U, status.st_uid);
  }
  std::string token(bytes.data(), static_cast<std::size_t>(count));
  token.resize(std::min(token.find('\n'), token.size()));
  const bool printable = std::ranges::all_of(token, [](char c) { return c > 0x20 && c < 0x7f; });
  if (token.size() < 16 || token.size() > 512 || !printable) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: holds no token; need a first line of 16 to 512 printable characters without "
                "spaces, as: (umask 077; openssl rand -hex 32 > {})",
                path.string(), path.string());
  }
  return token;
}

}  // namespace sateen
