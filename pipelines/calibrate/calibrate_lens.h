#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "calibration/lens/lens.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "scanner/sessions/board_views.h"

namespace sateen {

struct CalibrateLensOptions {
  std::filesystem::path photos;    // photographs or sessions of a board
  std::filesystem::path output;    // the rig file
  std::filesystem::path rig_file;  // to add to; empty: what is at `output`
  std::string board;               // "charuco:10x7:25mm:18mm"
};

// Largest distance of corners of one row or column from the straight line between its ends.
struct LineDeviation {
  double before_px = 0.0;  // as photographed
  double after_px = 0.0;   // without the lens's distortion
};

struct LensCalibration : RigCalibration {
  BoardSpec board;
  FoundBoards found;
  LensFit fit;
  LineDeviation line_deviation;              // of the view where it is largest
  std::optional<double> focal_error;         // relative, against the truth of a simulated board
  std::optional<double> principal_error_px;  // the same
  LensRecord record;
};

/// Fits the lens to photographs of a board (calibration/lens/lens.h), draws the pictures of
/// lens_pictures.h and writes the rig with the new lens; its pose, lights and all else stay.
///
/// Errors   kInvalidArgument: the board's text; as FindBoards(), CalibrateLens(), ReadRig()
///          kCancelled: nothing is written
[[nodiscard]] Result<LensCalibration> CalibrateLensFromPhotos(const CalibrateLensOptions& options,
                                                              const Task& task = {});

}  // namespace sateen
