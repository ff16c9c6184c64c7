#pragma once

#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/devices/find_camera.h"
#include "scanner/devices/serial_port.h"

namespace sateen::cli {

struct DevicesArgs {
  std::string port;    // connected to, whatever its USB id; empty: none
  std::string camera;  // connected to, whatever is on USB; empty: none
  bool json = false;
};

void AddDevices(CLI::App& root, DevicesArgs& args);

// Returns the exit status: 5 where no board answered. Asks the daemon where one is running and args
// name no device of their own.
int RunDevices(const DevicesArgs& args, const Task& task, std::ostream& out, std::ostream& log);
// Runs the same over given ports and cameras. Connects to those without an obstacle.
int RunDevicesAmong(const DevicesArgs& args, std::vector<SerialPortInfo> ports,
                    const std::function<std::unique_ptr<BytePort>(const std::string&)>& open,
                    const Task& task, std::ostream& out, std::ostream& log,
                    const std::vector<UsbCamera>& cameras = {});

}  // namespace sateen::cli
