#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/devices/find_camera.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/serial_port.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// A serial port or a camera, and its answer.
struct DeviceReply {
  std::string port;
  std::string usb;  // USB id of a serial port: "2341:0043"; empty: not on USB
  std::string description;
  std::string serial;  // serial number of a serial port
  bool is_camera = false;
  bool answers = false;  // whether it is an LED board, or a camera that is ready
  std::string what;      // its answer, or why it is taken for none
  // Fields of an LED board that answers.
  std::string firmware;
  std::string protocol;
  int lights = 0;
  // Fields of a camera that is ready.
  std::string model;
  std::string profile;
};

[[nodiscard]] DeviceReply ReplyOf(const SerialPortInfo& port);
[[nodiscard]] DeviceReply ReplyOf(const UsbCamera& camera);
// Takes the board's greeting, and what it reported after it: with a light on, it is none that does
// as it is told.
void TakeBoard(DeviceReply& reply, const BoardInfo& info, const Result<BoardReport>& report);
void TakeCamera(DeviceReply& reply, const CameraInfo& info);

// Writes the object of `sateen devices --json` (docs/formats.md), and reads it back. An indent
// below 0 gives one line.
[[nodiscard]] std::string DevicesJson(const std::vector<DeviceReply>& devices, int indent);
[[nodiscard]] Result<std::vector<DeviceReply>> DevicesFromJson(const std::string& text);

}  // namespace sateen
