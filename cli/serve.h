#pragma once

#include <filesystem>
#include <iosfwd>
#include <memory>
#include <string>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/capture/capture_options.h"
#include "scanner/devices/rig_devices.h"

namespace sateen::cli {

struct ServeArgs {
  std::filesystem::path socket;      // empty: where FindDaemon() looks first
  std::string listen;                // "127.0.0.1:8377"; empty: no TCP
  std::filesystem::path token_file;  // of TCP
  RigDeviceNames devices;
};

void AddServe(CLI::App& root, ServeArgs& args);

// Serve until the task is cancelled, which is how a daemon ends: exit status 0. The first opens the
// devices that args name. `capture` holds what a capture's request leaves open.
int RunServe(const ServeArgs& args, const Task& task, std::ostream& out, std::ostream& log);
int RunServeOn(const ServeArgs& args, std::unique_ptr<RigDevices> devices,
               const CaptureOptions& capture, const Task& task, std::ostream& out,
               std::ostream& log);

}  // namespace sateen::cli
