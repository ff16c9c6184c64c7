#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>

#include "cli/calibrate/calibrate_check.h"
#include "cli/calibrate/calibrate_lens.h"
#include "cli/calibrate/calibrate_lights.h"
#include "cli/calibrate/calibrate_pose.h"
#include "cli/calibrate/calibrate_response.h"
#include "cli/calibrate/calibrate_spheres.h"
#include "core/task.h"

namespace sateen::cli {

// What the subcommands of `sateen calibrate` are given; one of them runs.
struct CalibrateArgs {
  CalibrateLensArgs lens;
  CalibratePoseArgs pose;
  CalibrateLightsArgs lights;
  CalibrateResponseArgs response;
  CalibrateSpheresArgs spheres;
  CalibrateCheckArgs check;
};

void AddCalibrate(CLI::App& app, CalibrateArgs& args);

// Returns the exit status.
int RunCalibrate(const CLI::App& app, const CalibrateArgs& args, const Task& task,
                 std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
