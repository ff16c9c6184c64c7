#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/devices/byte_port.h"

namespace sateen {

// A serial port of this computer.
struct SerialPortInfo {
  struct UsbId {
    int vendor = 0;
    int product = 0;
  };

  std::string name;  // "/dev/ttyACM0"
  std::string description;
  std::optional<UsbId> usb;  // absent for ports that are not USB
  std::string serial;
  // Its USB id is one of an Arduino Uno or Nano, or of the bridges that copies of them have.
  bool may_be_board = false;
};

// Lists all ports, by name. kDevice where the system does not tell.
[[nodiscard]] Result<std::vector<SerialPortInfo>> ListSerialPorts();

// Finds the one port that may be an LED board. kDevice: there is none, or more than one.
[[nodiscard]] Result<std::string> FindBoardPort();

// Makes a port by its name, or, with an empty name, the one that FindBoardPort finds whenever it is
// opened: after it was unplugged and plugged in again its name may be another. 500 kbaud, and no
// other program may open it meanwhile. Over libserialport.
[[nodiscard]] std::unique_ptr<BytePort> MakeSerialPort(std::string name);

}  // namespace sateen
