#include "scanner/devices/rig_devices.h"

#include <utility>

#include "scanner/devices/find_camera.h"
#include "scanner/devices/serial_port.h"

namespace sateen {

RigDevices::RigDevices(RigDeviceNames names) : names_(std::move(names)) {}

RigDevices::RigDevices(std::unique_ptr<BytePort> port, std::unique_ptr<TetheredCamera> camera)
    : board_(LightBoard(std::move(port))), camera_(std::move(camera)) {}

RigDevices::~RigDevices() { Release(); }

Result<LightBoard*> RigDevices::Board(std::chrono::milliseconds port_wait) {
  if (!board_) {
    board_.emplace(MakeSerialPort(names_.port));
  }
  if (board_->state() != LightBoard::State::kReady) {
    if (const Status connected = board_->Connect(port_wait); !connected) {
      return tl::unexpected(connected.error());
    }
  }
  board_has_answered_ = true;
  return &*board_;
}

Result<TetheredCamera*> RigDevices::Camera() {
  if (!camera_) {
    Result<std::unique_ptr<TetheredCamera>> made =
        MakeTetheredCamera(names_.camera, /*decode=*/false);
    if (!made) {
      return tl::unexpected(made.error());
    }
    camera_ = *std::move(made);
  }
  if (!camera_info_) {
    const Result<CameraInfo> info = camera_->Open();
    if (!info) {
      return tl::unexpected(info.error());
    }
    camera_info_ = *info;
  }
  return camera_.get();
}

void RigDevices::Release() noexcept {
  if (board_) {
    board_->Close();
  }
  CloseCamera();
}

void RigDevices::CloseCamera() noexcept {
  if (camera_ && camera_info_) {
    camera_->Close();
    camera_info_.reset();
  }
}

}  // namespace sateen
