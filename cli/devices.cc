#include "cli/devices.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>
#include <ostream>
#include <utility>

#include "scanner/daemon/device_list.h"
#include "scanner/daemon/http/http_client.h"
#include "scanner/devices/light_board.h"

namespace sateen::cli {
namespace {

void AskPort(DeviceReply& device, std::unique_ptr<BytePort> port) {
  LightBoard board(std::move(port));
  const Status connected = board.Connect();
  if (!connected) {
    device.what = connected.error().message;
    return;
  }
  TakeBoard(device, board.Info(), board.Report());
}

// Connects to a camera as a capture does.
DeviceReply ConnectCamera(const UsbCamera& found) {
  DeviceReply device = ReplyOf(found);
  if (!device.what.empty()) {
    return device;
  }
  const Result<std::unique_ptr<TetheredCamera>> made = MakeTetheredCamera(found.port);
  const Result<CameraInfo> info =
      made ? (*made)->Open() : Result<CameraInfo>(tl::unexpected(made.error()));
  if (!info) {
    device.what = info.error().message;
    return device;
  }
  TakeCamera(device, *info);
  return device;
}

void PrintDevices(const std::vector<DeviceReply>& devices, std::ostream& out) {
  for (const DeviceReply& device : devices) {
    out << fmt::format("{:<14} {:<9} {}\n{:24} {}\n", device.port,
                       device.usb.empty() ? "-" : device.usb, device.description, "", device.what);
  }
  if (std::ranges::none_of(devices, &DeviceReply::is_camera)) {
    out << fmt::format("{:<24} {}\n", "no camera",
                       "none on USB: switch it on, use a cable with data lines; for one on the "
                       "network add --camera ptpip:ADDRESS");
  }
}

int DevicesFailed(const Error& error, std::ostream& log) {
  log << "sateen devices: error: " << error.message << '\n';
  return ExitStatus(error);
}

// `asked`: whether a port was asked at all.
int ReportDevices(const DevicesArgs& args, const std::vector<DeviceReply>& devices, bool asked,
                  std::ostream& out, std::ostream& log) {
  if (args.json) {
    out << DevicesJson(devices, /*indent=*/2) << '\n';
  } else {
    PrintDevices(devices, out);
  }
  if (std::ranges::any_of(devices, [](const auto& d) { return d.answers && !d.is_camera; })) {
    return 0;
  }
  const auto ports = std::ranges::count(devices, false, &DeviceReply::is_camera);
  return DevicesFailed(
      {ErrorCode::kDevice,
       asked ? "no LED board answered; fix what is reported for each port above, or upload "
               "the firmware (make flash)"
             : fmt::format("no LED board among {} serial port{}; plug it in, or give its "
                           "port by --port",
                           ports, ports == 1 ? "" : "s")},
      log);
}

int RunDevicesByDaemon(const DevicesArgs& args, const DaemonClient& daemon, std::ostream& out,
                       std::ostream& log) {
  const Result<std::vector<DeviceReply>> devices = DevicesByDaemon(daemon);
  return devices ? ReportDevices(args, *devices, /*asked=*/true, out, log)
                 : DevicesFailed(devices.error(), log);
}

}  // namespace

void AddDevices(CLI::App& root, DevicesArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "devices",
      "List serial ports and cameras. Connects to each port that may be an LED board, which turns "
      "its lights off, and to each camera; reports what is missing and how to fix it");
  cmd->add_option("--port", args.port, "Connect to this port too, whatever its USB id")
      ->envname("SATEEN_PORT");
  cmd->add_option("--camera", args.camera,
                  "Connect to this camera too: ptpip:ADDRESS, usb:BUS,DEVICE or folder:DIR")
      ->envname("SATEEN_CAMERA");
  cmd->add_flag("--json", args.json, "Print JSON");
}

int RunDevices(const DevicesArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  if (args.port.empty() && args.camera.empty()) {
    const Result<std::optional<DaemonClient>> daemon = FindDaemon();
    if (!daemon) {
      return DevicesFailed(daemon.error(), log);
    }
    if (*daemon) {
      return RunDevicesByDaemon(args, **daemon, out, log);
    }
  }
  Result<std::vector<SerialPortInfo>> ports = ListSerialPorts();
  if (!ports && args.port.empty()) {
    return DevicesFailed(ports.error(), log);
  }
  return RunDevicesAmong(args, ports ? *std::move(ports) : std::vector<SerialPortInfo>{},
                         MakeSerialPort, task, out, log, ListUsbCameras());
}

int RunDevicesAmong(const DevicesArgs& args, std::vector<SerialPortInfo> ports,
                    const std::function<std::unique_ptr<BytePort>(const std::string&)>& open,
                    const Task& task, std::ostream& out, std::ostream& log,
                    const std::vector<UsbCamera>& cameras) {
  if (!args.port.empty()) {
    auto named = std::ranges::find(ports, args.port, &SerialPortInfo::name);
    if (named == ports.end()) {
      named = ports.insert(named, {.name = args.port, .description = "given by --port"});
    }
    named->may_be_board = true;
  }
  std::vector<DeviceReply> devices;
  for (const SerialPortInfo& port : ports) {
    if (const Status going = task.CheckCancelled(); !going) {
      return DevicesFailed(going.error(), log);
    }
    devices.push_back(ReplyOf(port));
    if (port.may_be_board) {
      AskPort(devices.back(), open(port.name));
    }
  }
  for (const UsbCamera& found : cameras) {
    devices.push_back(ConnectCamera(found));
  }
  if (!args.camera.empty() &&
      std::ranges::find(cameras, args.camera, &UsbCamera::port) == cameras.end()) {
    devices.push_back(ConnectCamera({.port = args.camera, .description = "given by --camera"}));
  }
  return ReportDevices(args, devices, std::ranges::any_of(ports, &SerialPortInfo::may_be_board),
                       out, log);
}

}  // namespace sateen::cli
