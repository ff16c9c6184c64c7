#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "calibration/lens/pose.h"
#include "cli/command.h"
#include "core/task.h"
#include "pipelines/calibrate/rig_calibration.h"
#include "rig/rig.h"
#include "scanner/sessions/board_views.h"

namespace sateen::cli {

struct CalibratePoseArgs {
  std::filesystem::path photos;
  std::filesystem::path output;    // the rig file
  std::filesystem::path rig_file;  // whose lens is used; empty: what is at `output`
  std::string board;               // empty: that of the lens's calibration
  double thickness_mm = 0.0;       // of the board
  int threads = 0;
  bool json = false;
};

struct PoseCalibration : RigCalibration {
  BoardSpec board;
  FoundBoards found;
  size_t corners = 0;
  PoseFit fit;              // of the board's plane
  double edge_sd_mm = 0.0;  // of where a pixel meets the table, worst corner of the image
  double moved_mm = 0.0;    // the camera, from the former pose; 0 without one
  double turned_deg = 0.0;
  std::optional<double> position_error_mm;  // against truth/rig.json of a simulated board
  std::optional<double> rotation_error_deg;
};

void AddCalibratePose(CLI::App& calibrate, CalibratePoseArgs& args);
int RunCalibratePose(const CalibratePoseArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log);

// The report of a pose, for programs (schema sateen.calibrate.pose/1) and for a person.
[[nodiscard]] std::string JsonReport(const CalibratePoseArgs& args, const PoseCalibration& result);
[[nodiscard]] std::string TextReport(const CalibratePoseArgs& args, const PoseCalibration& result);

// axes.png in `result.pictures`: the first photograph with the table's axes and a grid of 50 mm.
[[nodiscard]] Status DrawPose(const PoseCalibration& result, double thickness_mm);

}  // namespace sateen::cli
