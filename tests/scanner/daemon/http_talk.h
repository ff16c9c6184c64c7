#pragma once

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>

// HTTP by hand, right or wrong: bytes that no client library would send.
namespace sateen::testing {

// One connection; its end closes it.
class RawClient {
 public:
  explicit RawClient(const std::filesystem::path& path) {
    sockaddr_un address = {.sun_family = AF_UNIX};
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    Open(AF_UNIX, static_cast<const sockaddr*>(static_cast<const void*>(&address)), sizeof address);
  }
  explicit RawClient(int port) {
    sockaddr_in address = {.sin_family = AF_INET,
                           .sin_port = htons(static_cast<std::uint16_t>(port))};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    Open(AF_INET, static_cast<const sockaddr*>(static_cast<const void*>(&address)), sizeof address);
  }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  ~RawClient() { close(fd_); }

  [[nodiscard]] bool Connected() const { return connected_; }
  bool Send(const std::string& bytes) const {
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t count = send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (count <= 0) {
        return false;
      }
      sent += static_cast<std::size_t>(count);
    }
    return true;
  }
  // Says that nothing more will be sent; answers can still be read.
  void EndSending() const { shutdown(fd_, SHUT_WR); }
  // Reads until `until` has come or the other end closes; gives up after a minute.
  std::string Read(const std::string& until = std::string()) {
    while (until.empty() || text_.find(until) == std::string::npos) {
      pollfd entry = {.fd = fd_, .events = POLLIN};
      std::array<char, 4096> bytes = {};
      const ssize_t count =
          poll(&entry, 1, 60'000) > 0 ? recv(fd_, bytes.data(), bytes.size(), 0) : 0;
      if (count <= 0) {
        break;
      }
      text_.append(bytes.data(), static_cast<std::size_t>(count));
    }
    return text_;
  }

 private:
  void Open(int family, const sockaddr* address, socklen_t size) {
    fd_ = socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    connected_ = connect(fd_, address, size) == 0;
  }

  int fd_ = -1;
  bool connected_ = false;
  std::string text_;
};

inline std::string HttpRequest(const std::string& method, const std::string& path,
                               const std::string& body = std::string(),
                               const std::string& headers = "Host: localhost\r\n") {
  const std::string length =
      body.empty()
          ? ""
          : fmt::format("Content-Type: application/json\r\nContent-Length: {}\r\n", body.size());
  return fmt::format("{} {} HTTP/1.1\r\n{}{}\r\n{}", method, path, headers, length, body);
}

// 0 where the answer is no HTTP.
inline int StatusOf(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? std::atoi(answer.c_str() + 9) : 0;
}

inline std::string BodyOf(const std::string& answer) {
  const std::size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

// Sends it on a connection of its own and reads to the end.
template <typename Place>
std::string Exchange(const Place& place, const std::string& bytes) {
  RawClient client(place);
  client.Send(bytes);
  return client.Read();
}

}  // namespace sateen::testing
