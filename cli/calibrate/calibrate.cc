#include "cli/calibrate/calibrate.h"

#include "core/check.h"

namespace sateen::cli {

void AddCalibrate(CLI::App& app, CalibrateArgs& args) {
  CLI::App* calibrate =
      app.add_subcommand("calibrate", "Measure the rig: its lens, pose, response and lights");
  calibrate->require_subcommand(1);
  AddCalibrateLens(*calibrate, args.lens);
  AddCalibratePose(*calibrate, args.pose);
  AddCalibrateResponse(*calibrate, args.response);
  AddCalibrateLights(*calibrate, args.lights);
  AddCalibrateCheck(*calibrate, args.check);
  AddCalibrateSpheres(*calibrate, args.spheres);
}

int RunCalibrate(const CLI::App& app, const CalibrateArgs& args, const Task& task,
                 std::ostream& out, std::ostream& log) {
  const CLI::App* chosen = app.get_subcommand("calibrate")->get_subcommands().front();
  const std::string& name = chosen->get_name();
  if (name == "lens") {
    return RunCalibrateLens(args.lens, task, out, log);
  }
  if (name == "pose") {
    return RunCalibratePose(args.pose, task, out, log);
  }
  if (name == "response") {
    return RunCalibrateResponse(args.response, task, out, log);
  }
  if (name == "lights") {
    return RunCalibrateLights(args.lights, task, out, log);
  }
  if (name == "check") {
    return RunCalibrateCheck(args.check, task, out, log);
  }
  SATEEN_CHECK(name == "spheres");
  return RunCalibrateSpheres(args.spheres, task, out, log);
}

}  // namespace sateen::cli
