#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/lens/lens.h"
#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "rig/rig.h"
#include "scanner/sessions/board_views.h"

namespace sateen::cli {

struct CalibrateLensArgs {
  std::filesystem::path photos;
  std::filesystem::path output;    // the rig file
  std::filesystem::path rig_file;  // to add to; empty: what is at `output`
  std::string board;
  int threads = 0;
  bool json = false;
};

// How far corners of one row or column lie from the straight line between its ends, at most.
struct LineDeviation {
  double before_px = 0.0;  // as photographed
  double after_px = 0.0;   // without the lens's distortion
};

struct LensCalibration : RigCalibration {
  BoardSpec board;
  FoundBoards found;
  LensFit fit;
  LineDeviation line_deviation;       // of the view where it is largest
  std::optional<double> focal_error;  // relative, against truth/rig.json of a simulated board
  std::optional<double> principal_error_px;  // the same
};

void AddCalibrateLens(CLI::App& calibrate, CalibrateLensArgs& args);
int RunCalibrateLens(const CalibrateLensArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

}  // namespace sateen::cli
