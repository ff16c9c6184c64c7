#pragma once

#include <chrono>
#include <optional>

#include "core/error.h"
#include "scanner/checks/frame_check_options.h"
#include "scanner/sessions/session.h"

namespace sateen {

// Options of a capture. Those that decide about its frames are in the journal and kept on resuming.
struct CaptureOptions {
  SessionKind kind = SessionKind::kFabric;
  // Exposure time of every frame, (0, 60] s. Absent: found by test frames (ExposureSearch).
  std::optional<double> exposure_s;
  double f_number = 8.0;
  double iso = 100.0;
  // Largest number of exposures per light where they are found: 1 to 3. A sheet always has one.
  int brackets = 3;
  // Level of each light, (0, 1].
  double level = 1.0;
  // Time from turning a light on to the exposure; 0 to 1.5 s: then the board must hear something.
  std::chrono::milliseconds settle{30};
  // Time beyond the exposure that a light may stay on, until the camera has delivered. 1 ms to
  // 60 s; no longer than the board allows.
  std::chrono::milliseconds margin{6000};
  // Longest wait for a frame beyond its exposure; at least 1 ms.
  std::chrono::milliseconds deadline{30'000};
  // Interval of talking to the board while the camera exposes, in a thread of its own, so that it
  // keeps the light on; less than its 2 s of silence. 0: never, for a board in simulated time.
  std::chrono::milliseconds keep_alive{400};
  // Number of times that a frame is tried before its failure ends the capture; at least 1.
  int tries = 3;
  FrameCheckOptions checks;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

}  // namespace sateen
