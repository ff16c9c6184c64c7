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

// One capture as an operator asks for it, with `sateen capture` or through the daemon.
struct CaptureRequest {
  std::filesystem::path rig;     // not used on resuming: the session has its own
  std::filesystem::path output;  // folder of the session
  bool resume = false;
  // On resuming: take every frame again, at the exposure of `options`; it is found where absent.
  bool new_exposure = false;
  CaptureOptions options;
};

/// Begins or resumes a session and takes it to its end with the devices, which it opens first where
/// they are not. In every case all lights are off at the end.
///
/// Errors   as CaptureSession; kDevice where no board or no camera is found
[[nodiscard]] Result<CaptureSummary> RunCapture(const CaptureRequest& request, RigDevices& devices,
                                                const Task& task,
                                                const CaptureObserver& observer = {});

// Fails if the request would be refused before a device is opened: for its rig, folder or options.
[[nodiscard]] Status CheckCapture(const CaptureRequest& request);

// Forecast of a capture that takes no frame and writes no file: --dry-run.
struct CaptureForecast {
  CaptureRequest request;
  FramePlan plan;               // at one exposure where it is still to be found
  bool exposure_known = false;  // given by hand
  std::string port;             // port of the board
  std::string firmware;
  CameraInfo camera;
  ExposureSettings settings;  // as the camera has them now
  std::uintmax_t bytes = 0;   // approximate size of the session
  std::uintmax_t free_bytes = 0;
};

/// Checks whether the capture can begin: rig, devices, settings, channels of the board, free space.
/// Sets the camera; the lights stay off.
///
/// Errors   those with which the capture would end before its first frame
[[nodiscard]] Result<CaptureForecast> ForecastCapture(const CaptureRequest& request,
                                                      RigDevices& devices);

}  // namespace sateen
