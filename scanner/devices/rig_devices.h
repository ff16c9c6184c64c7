#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/error.h"
#include "scanner/devices/byte_port.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Which devices make up the rig.
struct RigDeviceNames {
  std::string port;  // serial port of the LED board; empty: the only one that may be it
  std::string
      camera;  // "usb:001,004", "ptpip:192.168.1.1", "folder:DIR"; empty: the only one on USB
};

// The LED board and the camera of the rig, opened when first asked for, and open until Release() or
// the end of this. One owner, one thread at a time.
class RigDevices {
 public:
  explicit RigDevices(RigDeviceNames names);
  // Other devices than names find: for tests.
  RigDevices(std::unique_ptr<BytePort> port, std::unique_ptr<TetheredCamera> camera);
  RigDevices(const RigDevices&) = delete;
  RigDevices& operator=(const RigDevices&) = delete;
  ~RigDevices();

  // Returns the connected board; what was lost is connected anew, and its port waited for at most
  // `port_wait`. kDevice: none, or it does not answer.
  [[nodiscard]] Result<LightBoard*> Board(
      std::chrono::milliseconds port_wait = kUntilGreetingTimeout);
  // Returns whether a board has ever answered: then a light of it may be on.
  [[nodiscard]] bool BoardHasAnswered() const { return board_has_answered_; }
  // Returns the open camera; what was lost is opened anew. kDevice: none, or it cannot be used, and
  // how to fix it.
  [[nodiscard]] Result<TetheredCamera*> Camera();
  // Closes the camera after an error that may have been its own, so that Camera() opens it anew.
  void CloseCamera() noexcept;
  // Returns the camera's answer on opening; nothing where it is not open.
  [[nodiscard]] const std::optional<CameraInfo>& OpenCamera() const { return camera_info_; }

  // Turns all lights off and closes both devices.
  void Release() noexcept;

 private:
  RigDeviceNames names_;
  std::optional<LightBoard> board_;
  bool board_has_answered_ = false;
  std::unique_ptr<TetheredCamera> camera_;
  std::optional<CameraInfo> camera_info_;
};

}  // namespace sateen
