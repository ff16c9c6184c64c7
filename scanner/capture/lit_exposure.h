#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "rig/light.h"
#include "scanner/capture/capture_options.h"
#include "scanner/devices/light_board.h"
#include "scanner/devices/tethered_camera.h"

namespace sateen {

// What is exposed.
struct LitExposure {
  const Light* light = nullptr;  // null: the dark
  double level = 1.0;
  double exposure_s = 0.0;  // as the camera has it
};

struct LitFrame {
  CapturedFile file;
  std::chrono::duration<double> camera_time{};  // exposing and transferring
};

/// One exposure under one light:
///
///     1. the light goes on, for no longer than exposure and margin, and the board answers that it
///        alone is on
///     2. the camera exposes and delivers into `folder`; a thread keeps talking to the board, which
///        turns everything off when it hears nothing for 2 s
///     3. the board is asked again: a light that went off before the camera had delivered, or a board
///        that has restarted, makes the frame worth nothing
///     4. all off, and the board's word that it is so
///
/// Connects the board where it is not. However it ends, all lights have been told to go off; a
/// cancelled task turns them off at once.
///
/// Errors   kDevice, kTimeout: board or camera; kIo: the disk; kCancelled
[[nodiscard]] Result<LitFrame> ExposeLit(LightBoard& board, TetheredCamera& camera,
                                         const LitExposure& exposure, const CaptureOptions& options,
                                         const std::filesystem::path& folder, const Task& task);

// Longest exposure for which the board lets a light be on, margin and all; s.
[[nodiscard]] double LongestExposure(const BoardInfo& board, const Light& light,
                                     const CaptureOptions& options);

}  // namespace sateen
