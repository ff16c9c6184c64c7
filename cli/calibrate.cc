#include "cli/calibrate.h"

#include "core/check.h"

namespace sateen::cli {

void AddCalibrate(CLI::App& app, CalibrateArgs& args) {
  CLI::App* calibrate = app.add_subcommand("calibrate", "Measure the rig: its lights");
  calibrate->require_subcommand(1);
  AddCalibrateLights(*calibrate, args.lights);
}

int RunCalibrate(const CLI::App& app, const CalibrateArgs& args, const Task& task,
                 std::ostream& out, std::ostream& log) {
  const CLI::App* chosen = app.get_subcommand("calibrate")->get_subcommands().front();
  const std::string& name = chosen->get_name();
  SATEEN_CHECK(name == "lights");
  return RunCalibrateLights(args.lights, task, out, log);
}

}  // namespace sateen::cli
