#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/capture/preview.h"

namespace sateen::cli {

struct PreviewArgs {
  PreviewRequest request;
  RigDeviceNames devices;
  std::filesystem::path output = "preview.jpg";
  std::string light;  // empty: room light alone
  std::string exposure = "auto";
  std::string level = "100%";
};

void AddPreview(CLI::App& root, PreviewArgs& args);

// Asks the daemon where one is running and args name no device. Returns the exit status.
int RunPreview(const PreviewArgs& args, const Task& task, std::ostream& out, std::ostream& log);
// Runs the same on given devices.
int RunPreviewWith(const PreviewArgs& args, RigDevices& devices, const Task& task,
                   std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
