#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace sateen {

struct ConnectionLimits {
  // The whole request, however slowly it comes; and each piece of the answer that the client does
  // not take.
  std::chrono::milliseconds read{10'000};
  std::chrono::milliseconds write{10'000};
  // After the answer: how long the client is read that still sends.
  std::chrono::milliseconds drain{500};
  // Request line, headers and body together.
  std::size_t request_bytes = std::size_t{128} * 1024;
};

// Outcome of reading from a client.
enum class Heard {
  kBytes,
  kEnd,   // the client sends no more, or has gone
  kLate,  // the deadline has passed
  kFull,  // the limit of bytes is reached
};

/// One accepted connection, with a deadline and a limit for what is read of it.
class Connection {
 public:
  // Borrows the descriptor, which must not block; the caller closes it afterwards.
  Connection(int fd, const ConnectionLimits& limits);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  // Ends the connection so that the client can read the answer: reads for a moment what it
  // still sends.
  ~Connection();

  // Waits for the next bytes and appends them to `into`.
  [[nodiscard]] Heard Read(std::string& into);
  // Writes everything. Returns false where the client is gone or takes nothing for too long.
  [[nodiscard]] bool Write(std::string_view bytes);
  // Returns whether the client has left. One that has only ended its request is still there; over
  // TCP the two cannot be told apart, and it counts as gone.
  [[nodiscard]] bool HasLeft() const;

  // Returns "process 4711 (sateen) of alice" on a Unix socket, "127.0.0.1 port 51234" on TCP.
  [[nodiscard]] std::string PeerName() const;

 private:
  // False where it did not within `longest`.
  [[nodiscard]] bool WaitFor(short what, std::chrono::milliseconds longest) const;

  const int fd_;
  const short gone_;  // what poll() reports of a client that has left
  const ConnectionLimits limits_;
  const std::chrono::steady_clock::time_point deadline_;
  std::size_t bytes_read_ = 0;
  std::array<char, 4096> buffer_ = {};
};

}  // namespace sateen
