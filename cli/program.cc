#include "cli/program.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "cli/bench/bench_accuracy.h"
#include "cli/bench/bench_calibrate.h"
#include "cli/bench/bench_simulate.h"
#include "cli/bench/bench_solve.h"
#include "cli/board_print.h"
#include "cli/calibrate/calibrate_check.h"
#include "cli/calibrate/calibrate_lens.h"
#include "cli/calibrate/calibrate_lights.h"
#include "cli/calibrate/calibrate_pose.h"
#include "cli/calibrate/calibrate_response.h"
#include "cli/calibrate/calibrate_spheres.h"
#include "cli/capture.h"
#include "cli/command.h"
#include "cli/devices.h"
#include "cli/help.h"
#include "cli/light.h"
#include "cli/preview.h"
#include "cli/serve.h"
#include "cli/session_overview.h"
#include "cli/session_verify.h"
#include "cli/simulate.h"
#include "cli/solve.h"
#include "core/notice.h"
#include "core/printable.h"
#include "core/version.h"

namespace sateen::cli {
namespace {

constexpr int kUsage = 2;
constexpr int kInputOutput = 4;

// In the order of the help.
CommandTable AddCommands(CLI::App& app) {
  CommandTable table;
  table.Add(app, AddSolve, RunSolve);
  table.Add(app, AddSimulate, RunSimulate);
  CLI::App& calibrate =
      AddGroup(app, "calibrate", "Measure the rig: its lens, pose, response and lights");
  table.Add(calibrate, AddCalibrateLens, RunCalibrateLens);
  table.Add(calibrate, AddCalibratePose, RunCalibratePose);
  table.Add(calibrate, AddCalibrateResponse, RunCalibrateResponse);
  table.Add(calibrate, AddCalibrateLights, RunCalibrateLights);
  table.Add(calibrate, AddCalibrateCheck, RunCalibrateCheck);
  table.Add(calibrate, AddCalibrateSpheres, RunCalibrateSpheres);
  CLI::App& board = AddGroup(app, "board", "Boards and sheets for calibration");
  table.Add(board, AddBoardPrint, RunBoardPrint);
  table.Add(app, AddCapture, RunCaptureCommand);
  table.Add(app, AddPreview, RunPreview);
  table.Add(app, AddLight, RunLight);
  table.Add(app, AddDevices, RunDevices);
  table.Add(app, AddServe, RunServe);
  CLI::App& session = AddGroup(app, "session", "Verify and show sessions on disk");
  table.Add(session, AddSessionVerify, RunSessionVerify);
  table.Add(session, AddSessionOverview, RunSessionOverview);
  CLI::App& bench = AddGroup(app, "bench", "Measure speed against error on this machine");
  table.Add(bench, AddBenchSolve, RunBenchSolve);
  table.Add(bench, AddBenchAccuracy, RunBenchAccuracy);
  table.Add(bench, AddBenchSimulate, RunBenchSimulate);
  table.Add(bench, AddBenchCalibrate, RunBenchCalibrate);
  return table;
}

}  // namespace

int RunProgram(int argc, const char* const* argv, const Task& task, std::ostream& raw_out,
               std::ostream& raw_log) {
  // Names from files, cameras and boards are in what is printed; no terminal obeys them.
  PrintableStream out(raw_out);
  PrintableStream log(raw_log);
  log.tie(&out);
  log << std::unitbuf;
  CLI::App app("Photometric-stereo scanner: from frames to normal and albedo maps", "sateen");
  app.require_subcommand(1);
  app.set_version_flag("--version", "sateen " + Version());
  app.footer(
      "Exit status: 0 done, 1 internal error, 2 usage, 3 bad or degenerate data, 4 input or "
      "output,\n             5 device, 6 cancelled.");
  WrapHelp(app);
  const CommandTable table = AddCommands(app);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return fmt::format("sateen: error: {}\nRun with --help for more information.\n", error.what());
  });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error, out, log) == 0 ? 0 : kUsage;
  }
  const NoticesTo log_notices([&](const std::string& text) {
    task.ClearProgress();
    log << "sateen: note: " << text << '\n';
  });
  const int status = table.RunTyped(task, out, log);
  if (status == 0 && !out.flush()) {
    log << "sateen: error: standard output cannot be written; is the disk full, or its reader "
           "gone?\n";
    return kInputOutput;
  }
  return status;
}

}  // namespace sateen::cli
