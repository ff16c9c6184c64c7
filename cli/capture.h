#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/capture/capture_request.h"
#include "scanner/daemon/http/http_client.h"

namespace sateen::cli {

struct CaptureArgs {
  CaptureRequest request;
  std::filesystem::path resume;  // session to continue; empty: a new one
  RigDeviceNames devices;
  bool sheet = false;
  std::string exposure;  // empty: auto, or with resume as before
  std::string level = "100%";
  std::string settle = "30ms";
  std::string margin = "6s";
  std::string deadline = "30s";
  bool dry_run = false;
  bool json = false;
};

void AddCapture(CLI::App& root, CaptureArgs& args);

// Asks the daemon where one is running and args name no device; else opens board and camera.
// Returns the exit status.
int RunCaptureCommand(const CaptureArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log);
// Run the same on given devices, and by a daemon.
int RunCaptureWith(const CaptureArgs& args, RigDevices& devices, const Task& task,
                   std::ostream& out, std::ostream& log);
int RunCaptureByDaemon(const CaptureArgs& args, const DaemonClient& daemon, const Task& task,
                       std::ostream& out, std::ostream& log);

// Report a capture and a dry run, as text and as JSON (docs/formats.md).
[[nodiscard]] std::string CaptureText(const std::filesystem::path& session, const Rig& rig,
                                      const CaptureSummary& summary);
[[nodiscard]] std::string CaptureJson(const std::filesystem::path& session, const Rig& rig,
                                      const CaptureSummary& summary);
[[nodiscard]] std::string ForecastText(const CaptureForecast& forecast);
[[nodiscard]] std::string ForecastJson(const CaptureForecast& forecast);

}  // namespace sateen::cli
