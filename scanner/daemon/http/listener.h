#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"

namespace sateen {

// A socket that waits for connections, on this computer only. Owns its descriptor and its file.
class Listener {
 public:
  /// Listens on a Unix socket to which only its owner, and root, may connect: the file is made with
  /// mode 0600. A file `path`.lock is locked for as long as this lives, so that one of two daemons
  /// that start at once wins; it must be a regular file of this user, and no link. The socket that a killed daemon left is replaced.
  ///
  /// Errors  kDevice: a daemon has this socket; kIo: something else is there, or the system
  ///         refuses; kInvalidArgument: longer than the system's 107 bytes
  [[nodiscard]] static Result<Listener> OnUnixSocket(const std::filesystem::path& path);
  /// Listens on "127.0.0.1:8377", "localhost:8377" or "[::1]:8377"; port 0 takes a free one.
  ///
  /// Errors  kInvalidArgument: another address; kIo: the port is in use
  [[nodiscard]] static Result<Listener> OnLoopback(const std::string& address);

  Listener(Listener&& other) noexcept;
  Listener& operator=(Listener&&) = delete;
  ~Listener();

  [[nodiscard]] int Descriptor() const { return fd_; }
  // Returns the port; 0 for a Unix socket.
  [[nodiscard]] int Port() const { return port_; }
  // Returns "unix:/run/user/1000/sateen.sock" or "http://127.0.0.1:8377".
  [[nodiscard]] const std::string& Name() const { return name_; }

 private:
  Listener() = default;

  int fd_ = -1;
  int lock_ = -1;
  int port_ = 0;
  std::filesystem::path path_;  // path of a Unix socket
  std::string name_;
};

// Returns $XDG_RUNTIME_DIR/sateen.sock; without that folder /run/sateen/sateen.sock.
[[nodiscard]] std::filesystem::path DefaultSocketPath();

}  // namespace sateen
