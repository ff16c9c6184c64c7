#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// Makes a camera by its name, as people write it: "usb:001,004", "ptpip:192.168.1.1", "folder:DIR";
// empty: the only camera on USB when it is opened. A caller that decodes every frame anyway asks
// for no decoding here. kInvalidArgument for other names.
[[nodiscard]] Result<std::unique_ptr<TetheredCamera>> MakeTetheredCamera(const std::string& name,
                                                                         bool decode = true);

// A camera as the system sees it, without libgphoto2.
struct UsbCamera {
  std::string port;  // libgphoto2's name: "usb:001,004"
  std::string description;
  // Reason why it cannot be used as it is, and how to fix it; empty: none is known.
  std::string obstacle;
};

// Where the system shows its devices and processes; tests put folders of their own here.
struct SystemFolders {
  std::filesystem::path sys = "/sys";
  std::filesystem::path dev = "/dev";
  std::filesystem::path proc = "/proc";
};

// Devices on USB with a still-image interface, and those of camera makers that show themselves as a
// disk. Obstacles: no permission, held by the desktop's photo import (gvfs), the wrong USB mode.
[[nodiscard]] std::vector<UsbCamera> ListUsbCameras(const SystemFolders& folders = {});

}  // namespace sateen
