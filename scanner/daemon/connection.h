#pragma once

#include <array>
#include <chrono>
#include <string>

#include "scanner/daemon/httplib.h"

// One accepted connection as cpp-httplib's parser reads and writes it. For .cc files only.
namespace sateen {

struct ConnectionLimits {
  // The whole request, however slowly it comes; and each piece of the answer that the client does not
  // take.
  std::chrono::milliseconds read{10'000};
  std::chrono::milliseconds write{10'000};
  // Request line, headers and body together.
  std::size_t request_bytes = std::size_t{128} * 1024;
};

class Connection : public httplib::Stream {
 public:
  // The descriptor does not block; it is the caller's, to be closed after this.
  Connection(int fd, const ConnectionLimits& limits);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  // Ends it so that the client can read the answer: what it still sends is read first, for a moment.
  ~Connection() override;

  bool is_readable() const override;
  // Whether the client is still there.
  bool is_writable() const override;
  ssize_t read(char* into, size_t size) override;
  ssize_t write(const char* from, size_t size) override;
  using Stream::write;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  socket_t socket() const override { return fd_; }

  // "process 4711 (sateen) of alice" on a Unix socket, "127.0.0.1 port 51234" on TCP.
  [[nodiscard]] std::string PeerName() const;

 private:
  // False where it did not within `longest`.
  [[nodiscard]] bool WaitFor(short what, std::chrono::milliseconds longest) const;

  const int fd_;
  const ConnectionLimits limits_;
  const std::chrono::steady_clock::time_point deadline_;
  std::size_t bytes_read_ = 0;
  std::array<char, 4096> buffer_ = {};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

}  // namespace sateen
