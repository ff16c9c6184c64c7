#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/files/own_folder.h"

namespace sateen {

// Identity that the virtual board shows on its USB: an Arduino Uno. Change the serial number to
// tell two apart.
struct UsbIdentity {
  std::string vendor_id = "2341";
  std::string product_id = "0043";
  std::string manufacturer = "Arduino (www.arduino.cc)";
  std::string product = "Sateen virtual LED board";
  std::string serial_number = "VIRTUAL0001";
};

// The host's end of the virtual board's serial line: a pseudo terminal, and a folder that shows it
// as the serial port of a USB device to programs that run with port_preload.c:
//
//     dev/ttyACM0                             -> /dev/pts/N
//     class/tty/ttyACM0                       -> ../../devices/usb1/1-1/1-1:1.0/tty/ttyACM0
//     devices/usb1/1-1/idVendor ...           what the kernel would tell about the device
//     devices/usb1/1-1/1-1:1.0/tty/ttyACM0/device -> ../../../1-1:1.0
//
// Unplugged, the first two are gone and whoever has the port open reads its end.
//
// A serial port that nobody has open loses what arrives, and so does this one. Bytes are garbled
// while the host's speed is not the board's. Not thread-safe.
class VirtualPort {
 public:
  // The folder is a new one under the system's temporary folder and goes with this object. `link`,
  // if any, is made to point to the pseudo terminal while plugged. kIo where the system refuses, or
  // where `link` is something else than a link to a terminal.
  static Result<VirtualPort> Open(const UsbIdentity& identity, std::optional<std::string> link);
  VirtualPort(VirtualPort&& other) noexcept;
  VirtualPort& operator=(VirtualPort&&) = delete;
  ~VirtualPort();

  // Returns the name of the pseudo terminal; empty while unplugged.
  [[nodiscard]] const std::string& Terminal() const { return terminal_; }
  [[nodiscard]] const std::filesystem::path& Folder() const { return folder_.Path(); }
  // Returns the board's name for a program under port_preload.c.
  [[nodiscard]] std::string Name() const { return "/dev/ttyACM0"; }

  Status Plug();
  void Unplug();
  [[nodiscard]] bool Plugged() const { return master_ >= 0; }

  // Waits until the host has sent something, but not longer than `longest`; then what it has sent.
  std::vector<uint8_t> Receive(std::chrono::microseconds longest, double board_baud);
  // Sends as much as the host's buffer holds; the rest is lost, as it is in a USB converter.
  void Send(const std::vector<uint8_t>& bytes, double board_baud);

  [[nodiscard]] uint64_t BytesLost() const { return bytes_lost_; }
  // Returns whether somebody has the port open, as of the last Receive().
  [[nodiscard]] bool InUse() const { return in_use_; }

 private:
  explicit VirtualPort(OwnFolder folder) : folder_(std::move(folder)) {}
  [[nodiscard]] bool SpeedsDiffer(double board_baud) const;

  OwnFolder folder_;
  std::optional<std::string> link_;
  std::string terminal_;
  int master_ = -1;
  bool in_use_ = false;
  uint64_t bytes_lost_ = 0;
};

}  // namespace sateen
