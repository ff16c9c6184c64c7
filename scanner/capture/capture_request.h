#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/capture_session.h"
#include "scanner/devices/rig_devices.h"

namespace sateen {

// One capture as an operator asks for it, by `sateen capture` or of the daemon.
struct CaptureRequest {
  std::filesystem::path rig;     // not on resuming: the session has its own
  std::filesystem::path output;  // folder of the session
  bool resume = false;
  // On resuming: every frame again, at the exposure of `options`, which is found where it has none.
  bool new_exposure = false;
  CaptureOptions options;
};

/// Begins or resumes a session and takes it to its end with the devices, which it opens first where
/// they are not. However it ends, all lights are off.
///
/// Errors   as CaptureSession; kDevice where no board or no camera is found
[[nodiscard]] Result<CaptureSummary> RunCapture(const CaptureRequest& request, RigDevices& devices,
                                                const Task& task,
                                                const CaptureObserver& observer = {});

// What it would be refused for before a device is opened: rig, folder, options.
[[nodiscard]] Status CheckCapture(const CaptureRequest& request);

// What a capture would do, without taking a frame or writing a file: --dry-run.
struct CaptureForecast {
  CaptureRequest request;
  FramePlan plan;               // at one exposure where it is still to be found
  bool exposure_known = false;  // asked for
  std::string port;             // of the board
  std::string firmware;
  CameraInfo camera;
  ExposureSettings settings;  // as the camera has them now
  std::uintmax_t bytes = 0;   // about, that the session takes
  std::uintmax_t free_bytes = 0;
};

/// Looks whether the capture could begin: rig, devices, settings, channels of the board, room on the
/// disk. Sets the camera; the lights stay off.
///
/// Errors   those that the capture would begin with
[[nodiscard]] Result<CaptureForecast> ForecastCapture(const CaptureRequest& request,
                                                      RigDevices& devices);

}  // namespace sateen
