#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

#include "core/task.h"
#include "scanner/serial_port.h"

namespace sateen::cli {

struct DevicesArgs {
  std::string port;  // asked too, whatever its USB id
  bool json = false;
};

void AddDevices(CLI::App& root, DevicesArgs& args);

// Returns the exit status: 5 where no device answered.
int RunDevices(const DevicesArgs& args, const Task& task, std::ostream& out, std::ostream& log);
// The same over ports that a test gives.
int RunDevicesAmong(const DevicesArgs& args, std::vector<SerialPortInfo> ports,
                    const std::function<std::unique_ptr<BytePort>(const std::string&)>& open,
                    const Task& task, std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
