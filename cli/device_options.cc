#include "cli/device_options.h"

#include <CLI/CLI.hpp>

namespace sateen::cli {

void AddDeviceOptions(CLI::App& cmd, RigDeviceNames& devices) {
  cmd.add_option("--port", devices.port,
                 "Serial port of the LED board, as /dev/ttyACM0; default: the one whose USB id is "
                 "an Arduino's")
      ->envname("SATEEN_PORT");
  cmd.add_option("--camera", devices.camera,
                 "Camera: usb:BUS,DEVICE, ptpip:ADDRESS, or folder:DIR for files that another "
                 "program drops; default: the only one on USB")
      ->envname("SATEEN_CAMERA");
}

Result<std::optional<DaemonClient>> DaemonFor(const RigDeviceNames& devices) {
  if (!devices.port.empty() || !devices.camera.empty()) {
    return std::optional<DaemonClient>();
  }
  return FindDaemon();
}

}  // namespace sateen::cli
