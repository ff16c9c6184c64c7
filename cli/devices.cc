#include "cli/devices.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "scanner/light_board.h"

namespace sateen::cli {
namespace {

struct Device {
  SerialPortInfo port;
  bool is_board = false;
  std::string what;  // what it said, or why it is taken for none
  BoardInfo info;
};

std::string UsbText(const SerialPortInfo& port) {
  return port.usb ? fmt::format("{:04x}:{:04x}", port.usb->vendor, port.usb->product) : "-";
}

void Ask(Device& device, std::unique_ptr<BytePort> port) {
  LightBoard board(std::move(port));
  const Status connected = board.Connect();
  if (!connected) {
    device.what = connected.error().message;
    return;
  }
  device.is_board = true;
  device.info = board.Info();
  device.what = fmt::format("LED board, firmware {}, protocol {}, {} lights", device.info.build_id,
                            device.info.protocol, device.info.lights.size());
}

struct CameraReply {
  UsbCamera found;
  bool answers = false;
  std::string what;  // what it said, or why it cannot be used
  CameraInfo info;
};

// What a capture would meet.
CameraReply Connect(const UsbCamera& found) {
  CameraReply camera = {.found = found, .what = found.obstacle};
  if (!camera.what.empty()) {
    return camera;
  }
  const Result<std::unique_ptr<TetheredCamera>> made = MakeTetheredCamera(found.port);
  const Result<CameraInfo> info =
      made ? (*made)->Open() : Result<CameraInfo>(tl::unexpected(made.error()));
  if (!info) {
    camera.what = info.error().message;
    return camera;
  }
  camera.answers = true;
  camera.info = *info;
  camera.what = fmt::format("camera {}, profile {}, ready to capture", info->model, info->profile);
  return camera;
}

nlohmann::json ToJson(const CameraReply& camera) {
  nlohmann::json json = {{"port", camera.found.port},
                         {"description", camera.found.description},
                         {"kind", "camera"},
                         {"ready", camera.answers},
                         {"what", camera.what}};
  if (camera.answers) {
    json["model"] = camera.info.model;
    json["profile"] = camera.info.profile;
  }
  return json;
}

nlohmann::json ToJson(const Device& device) {
  nlohmann::json json = {
      {"port", device.port.name},
      {"usb", device.port.usb ? nlohmann::json(UsbText(device.port)) : nlohmann::json()},
      {"description", device.port.description},
      {"serial", device.port.serial},
      {"kind", device.is_board ? "led-board" : "unknown"},
      {"what", device.what}};
  if (device.is_board) {
    json["firmware"] = device.info.build_id;
    json["protocol"] = device.info.protocol;
    json["lights"] = device.info.lights.size();
  }
  return json;
}

}  // namespace

void AddDevices(CLI::App& root, DevicesArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "devices",
      "List the serial ports and ask those that may be an LED board what they are, which turns "
      "their lights off; list the cameras, connect to each, and say what is missing and how to "
      "mend it");
  cmd->add_option("--port", args.port, "Ask this port too, whatever its USB id")
      ->envname("SATEEN_PORT");
  cmd->add_option("--camera", args.camera,
                  "Connect to this camera too: ptpip:ADDRESS, usb:BUS,DEVICE or folder:DIR")
      ->envname("SATEEN_CAMERA");
  cmd->add_flag("--json", args.json, "Print JSON");
}

int RunDevices(const DevicesArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  Result<std::vector<SerialPortInfo>> ports = ListSerialPorts();
  if (!ports && args.port.empty()) {
    log << "sateen devices: error: " << ports.error().message << '\n';
    return ExitStatus(ports.error());
  }
  return RunDevicesAmong(args, ports ? *std::move(ports) : std::vector<SerialPortInfo>{},
                         MakeSerialPort, task, out, log, ListUsbCameras());
}

int RunDevicesAmong(const DevicesArgs& args, std::vector<SerialPortInfo> ports,
                    const std::function<std::unique_ptr<BytePort>(const std::string&)>& open,
                    const Task& task, std::ostream& out, std::ostream& log,
                    const std::vector<UsbCamera>& found_cameras) {
  if (!args.port.empty()) {
    auto named = std::ranges::find(ports, args.port, &SerialPortInfo::name);
    if (named == ports.end()) {
      named = ports.insert(named, {.name = args.port, .description = "named with --port"});
    }
    named->may_be_board = true;
  }
  std::vector<Device> devices;
  for (const SerialPortInfo& port : ports) {
    if (const Status going = task.CheckCancelled(); !going) {
      log << "sateen devices: error: " << going.error().message << '\n';
      return ExitStatus(going.error());
    }
    devices.push_back({.port = port, .what = "not asked: not the USB id of an Arduino"});
    if (port.may_be_board) {
      Ask(devices.back(), open(port.name));
    }
  }
  std::vector<CameraReply> cameras;
  cameras.reserve(found_cameras.size() + 1);
  for (const UsbCamera& found : found_cameras) {
    cameras.push_back(Connect(found));
  }
  if (!args.camera.empty() && std::ranges::none_of(found_cameras, [&](const UsbCamera& found) {
        return found.port == args.camera;
      })) {
    cameras.push_back(Connect({.port = args.camera, .description = "named with --camera"}));
  }
  if (args.json) {
    nlohmann::json json = {{"schema", "sateen.devices/1"}, {"devices", nlohmann::json::array()}};
    for (const Device& device : devices) {
      json["devices"].push_back(ToJson(device));
    }
    for (const CameraReply& camera : cameras) {
      json["devices"].push_back(ToJson(camera));
    }
    out << json.dump(2) << '\n';
  } else {
    for (const Device& device : devices) {
      out << fmt::format("{:<14} {:<9} {}\n{:24} {}\n", device.port.name, UsbText(device.port),
                         device.port.description, "", device.what);
    }
  }
  if (!args.json) {
    for (const CameraReply& camera : cameras) {
      out << fmt::format("{:<14} {:<9} {}\n{:24} {}\n", camera.found.port, "-",
                         camera.found.description, "", camera.what);
    }
    if (cameras.empty()) {
      out << fmt::format("{:<24} {}\n", "no camera",
                         "none on USB: switch it on, use a cable with data lines; one on the "
                         "network: --camera ptpip:ADDRESS");
    }
  }
  if (std::ranges::none_of(devices, &Device::is_board)) {
    const bool was_asked =
        std::ranges::any_of(devices, [](const Device& device) { return device.port.may_be_board; });
    log << (was_asked
                ? std::string("sateen devices: error: no LED board answered; mend what is said of "
                              "each port above, or upload the firmware (make flash)\n")
                : fmt::format("sateen devices: error: no LED board among {} serial port{}; plug it "
                              "in, or name its port with --port\n",
                              devices.size(), devices.size() == 1 ? "" : "s"));
    return ExitStatus({ErrorCode::kDevice, ""});
  }
  return 0;
}

}  // namespace sateen::cli
