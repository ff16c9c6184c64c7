#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/capture_options.h"
#include "scanner/capture_session.h"
#include "scanner/rig_devices.h"

namespace sateen {

// One capture as an operator asks for it, by `sateen capture` or of the daemon.
struct CaptureRequest {
  std::filesystem::path rig;     // not on resuming: the session has its own
  std::filesystem::path output;  // folder of the session
  bool resume = false;
  CaptureOptions options;
};

// Where a capture is, after every frame and every change of stage.
struct CaptureEvent {
  std::string stage;  // "metering", "capturing", "checking"
  int frame = 0;      // frames that are done
  int frames = 0;     // of the plan
  std::string light;  // of the frame that is being taken; "dark" for none
  double exposure_s = 0.0;
  double peak = 0.0;  // of the latest frame: its 99.9th percentile, of what saturates
  std::optional<double> seconds_left;
};

using CaptureObserver = std::function<void(const CaptureEvent&)>;

/// Begins or resumes a session and takes it to its end with the devices, which it opens where they
/// are not. `observer` is called from the thread of the capture. However it ends, all lights are off.
///
/// Errors   as CaptureSession; kDevice where no board or no camera is found
[[nodiscard]] Result<CaptureSummary> RunCapture(const CaptureRequest& request, RigDevices& devices,
                                                const Task& task,
                                                const CaptureObserver& observer = {});

}  // namespace sateen
