#pragma once

#include <filesystem>
#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "rig/light.h"
#include "scanner/capture/capture_options.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// One exposure under one light.
struct LitExposure {
  std::optional<Light> light;  // absent: the dark
  double level = 1.0;          // level of the light, (0, 1]
  double exposure_s = 0.0;     // as the camera has it
};

struct LitFrame {
  CapturedFile file;
  double camera_s = 0.0;  // time of exposing and transferring
};

/// Exposes one frame under one light:
///
///     1. The light goes on, for no longer than exposure and margin, and the board confirms that it
///        alone is on.
///     2. The camera exposes and delivers into `folder`. A thread keeps talking to the board, which
///        turns everything off when it hears nothing for 2 s.
///     3. The board is asked again: the frame is worthless if the light went off before the camera
///        had delivered, or if the board restarted.
///     4. All lights go off, and the board confirms it.
///
/// Connects the board where it is not. In every case all lights have been told to go off at the
/// end, and what the board says to that is in the error; a cancelled task turns them off at once.
///
/// Errors   kDevice, kTimeout: board or camera; kIo: the disk; kCancelled: the board has confirmed
///          that all is off
[[nodiscard]] Result<LitFrame> ExposeLit(LightBoard& board, TetheredCamera& camera,
                                         const LitExposure& exposure, const CaptureOptions& options,
                                         const std::filesystem::path& folder, const Task& task);

// Turns all lights off. Fails unless the board says that they are; one that was never connected
// has no light on for this program.
[[nodiscard]] Status ConfirmDark(LightBoard& board);

// Returns the longest exposure for which the board lets a light be on, margin included. [s]
[[nodiscard]] double LongestExposure(const BoardInfo& board, const Light& light,
                                     const CaptureOptions& options);

}  // namespace sateen
