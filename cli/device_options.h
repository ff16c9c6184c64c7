#pragma once

#include <optional>

#include "cli/command.h"
#include "scanner/daemon/http/http_client.h"
#include "scanner/devices/rig_devices.h"

namespace sateen::cli {

// Adds --port and --camera.
void AddDeviceOptions(CLI::App& cmd, RigDeviceNames& devices);

// Finds the daemon that is running; nothing where a device is named.
[[nodiscard]] Result<std::optional<DaemonClient>> DaemonFor(const RigDeviceNames& devices);

}  // namespace sateen::cli
