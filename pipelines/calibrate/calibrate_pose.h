#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "calibration/lens/pose.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "scanner/sessions/board_views.h"

namespace sateen {

struct CalibratePoseOptions {
  std::filesystem::path photos;    // photographs or sessions of one lying board
  std::filesystem::path output;    // the rig file
  std::filesystem::path rig_file;  // whose lens is used; empty: what is at `output`
  std::string board;               // empty: that of the lens's calibration
  double thickness_mm = 0.0;       // of the board, up to 100
};

struct PoseCalibration : RigCalibration {
  BoardSpec board;
  FoundBoards found;
  size_t corners = 0;
  PoseFit fit;              // of the board's plane
  double lean_deg = 0.0;    // between the camera's axis and straight down
  double edge_sd_mm = 0.0;  // of where a pixel meets the table, worst corner of the image
  double moved_mm = 0.0;    // the camera, from the former pose; 0 without one
  double turned_deg = 0.0;
  std::optional<double> position_error_mm;  // against the truth of a simulated board
  std::optional<double> rotation_error_deg;
  PoseRecord record;
};

/// Fits the camera's pose to photographs of a board lying on the table (calibration/lens/pose.h),
/// draws the picture of pose_pictures.h and writes the rig with the new pose.
///
/// Errors   kInvalidArgument: thickness out of range; no board is named, and none is recorded
///          kBadData: the rig has no camera; as FindBoards(), FitPose(), ReadRig()
///          kCancelled: nothing is written
[[nodiscard]] Result<PoseCalibration> CalibratePoseFromPhotos(const CalibratePoseOptions& options,
                                                              const Task& task = {});

}  // namespace sateen
