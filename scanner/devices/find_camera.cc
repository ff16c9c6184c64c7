#include "scanner/devices/find_camera.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include "scanner/devices/folder_camera.h"
#include "scanner/devices/ptp_camera.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 7> kCameraMakers = {"04a9", "04b0", "04cb", "04da",
                                                           "054c", "07b4", "0a17"};
constexpr std::string_view kStillImage = "06";
constexpr std::string_view kDisk = "08";

std::string FirstLine(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::vector<fs::path> Entries(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    entries.push_back(entry->path());
  }
  std::ranges::sort(entries);
  return entries;
}

// The kernel keeps the first 15 letters of gvfs-gphoto2-volume-monitor and of gvfsd-gphoto2.
bool DesktopHoldsCameras(const fs::path& proc) {
  return std::ranges::any_of(Entries(proc), [](const fs::path& process) {
    const std::string name = FirstLine(process / "comm");
    return name == "gvfs-gphoto2-vo" || name == "gvfsd-gphoto2";
  });
}

bool HasInterface(const fs::path& device, std::string_view kind) {
  return std::ranges::any_of(Entries(device), [&](const fs::path& entry) {
    return FirstLine(entry / "bInterfaceClass") == kind;
  });
}

std::string Obstacle(const fs::path& device, const fs::path& node, bool held) {
  const std::string vendor = FirstLine(device / "idVendor");
  if (!HasInterface(device, kStillImage)) {
    return "it is connected as a disk: set its USB mode to PTP or MTP (on some cameras PC Remote)";
  }
  if (access(node.c_str(), R_OK | W_OK) != 0) {
    return fmt::format(
        "you have no permission to open {}: put SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{}\", "
        "MODE=\"0660\", TAG+=\"uaccess\" into /etc/udev/rules.d/70-sateen-camera.rules, then plug "
        "it in again",
        node.string(), vendor);
  }
  if (held) {
    return "the desktop's photo import may hold it: systemctl --user mask --now "
           "gvfs-gphoto2-volume-monitor, close its window in the file manager, plug it in again";
  }
  return "";
}

}  // namespace

Result<std::unique_ptr<TetheredCamera>> MakeTetheredCamera(const std::string& name, bool decode) {
  constexpr std::string_view kFolder = "folder:";
  if (name.starts_with(kFolder) && name.size() > kFolder.size()) {
    return std::make_unique<FolderCamera>(
        FolderCameraOptions{.folder = name.substr(kFolder.size())});
  }
  if (name.empty() || name.starts_with("usb:") || name.starts_with("ptpip:")) {
    return std::make_unique<PtpCamera>(PtpCameraOptions{.port = name, .decode = decode});
  }
  return Fail(ErrorCode::kInvalidArgument,
              "'{}' is not a camera; need usb:BUS,DEVICE or ptpip:ADDRESS, as sateen devices lists "
              "them, or folder:DIR",
              name);
}

std::vector<UsbCamera> ListUsbCameras(const SystemFolders& folders) {
  const bool held = DesktopHoldsCameras(folders.proc);
  std::vector<UsbCamera> cameras;
  for (const fs::path& device : Entries(folders.sys / "bus/usb/devices")) {
    const std::string vendor = FirstLine(device / "idVendor");
    const bool maker = std::ranges::count(kCameraMakers, vendor) > 0;
    if (!HasInterface(device, kStillImage) && !(maker && HasInterface(device, kDisk))) {
      continue;
    }
    const std::string bus = fmt::format("{:0>3}", FirstLine(device / "busnum"));
    const std::string number = fmt::format("{:0>3}", FirstLine(device / "devnum"));
    cameras.push_back({.port = fmt::format("usb:{},{}", bus, number),
                       .description = fmt::format("{} {}", FirstLine(device / "manufacturer"),
                                                  FirstLine(device / "product")),
                       .obstacle = Obstacle(device, folders.dev / "bus/usb" / bus / number, held)});
  }
  return cameras;
}

}  // namespace sateen
