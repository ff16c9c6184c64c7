#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <exception>
#include <iostream>
#include <new>

#include "cli/bench/bench_accuracy.h"
#include "cli/bench/bench_calibrate.h"
#include "cli/bench/bench_simulate.h"
#include "cli/bench/bench_solve.h"
#include "cli/board.h"
#include "cli/calibrate/calibrate.h"
#include "cli/capture.h"
#include "cli/devices.h"
#include "cli/light.h"
#include "cli/preview.h"
#include "cli/serve.h"
#include "cli/session.h"
#include "cli/simulate.h"
#include "cli/solve.h"
#include "core/interrupt.h"
#include "core/progress_bar.h"
#include "core/version.h"

namespace {

constexpr int kInternal = 1;
constexpr int kUsage = 2;
constexpr int kInputOutput = 4;

int Run(int argc, char** argv) {
  CLI::App app("Photometric-stereo scanner: from frames to normal and albedo maps", "sateen");
  app.require_subcommand(1);
  app.set_version_flag("--version", "sateen " + sateen::Version());
  app.footer(
      "Exit status: 0 done, 1 internal error, 2 usage, 3 bad or degenerate data, 4 input or "
      "output,\n             5 device, 6 cancelled.");
  sateen::cli::SolveArgs solve;
  sateen::cli::AddSolve(app, solve);
  sateen::cli::SimulateArgs simulate;
  sateen::cli::AddSimulate(app, simulate);
  sateen::cli::CalibrateArgs calibrate;
  sateen::cli::AddCalibrate(app, calibrate);
  sateen::cli::BoardPrintArgs board_print;
  sateen::cli::AddBoard(app, board_print);
  sateen::cli::CaptureArgs capture;
  sateen::cli::AddCapture(app, capture);
  sateen::cli::PreviewArgs preview;
  sateen::cli::AddPreview(app, preview);
  sateen::cli::LightArgs light;
  sateen::cli::AddLight(app, light);
  sateen::cli::DevicesArgs devices;
  sateen::cli::AddDevices(app, devices);
  sateen::cli::ServeArgs serve;
  sateen::cli::AddServe(app, serve);
  sateen::cli::SessionArgs session;
  sateen::cli::AddSession(app, session);
  CLI::App* bench = app.add_subcommand("bench", "Measure speed against error on this machine");
  bench->require_subcommand(1);
  sateen::cli::BenchSolveArgs bench_solve;
  sateen::cli::AddBenchSolve(*bench, bench_solve);
  sateen::cli::BenchAccuracyArgs bench_accuracy;
  sateen::cli::AddBenchAccuracy(*bench, bench_accuracy);
  sateen::cli::BenchSimulateArgs bench_simulate;
  sateen::cli::AddBenchSimulate(*bench, bench_simulate);
  sateen::cli::BenchCalibrateArgs bench_calibrate;
  sateen::cli::AddBenchCalibrate(*bench, bench_calibrate);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return fmt::format("sateen: error: {}\nRun with --help for more information.\n", error.what());
  });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kUsage;
  }
  sateen::InstallInterruptHandlers();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of writing, not an end
  sateen::ProgressBar progress(2);
  const sateen::Task task{.progress = &progress, .cancel = &sateen::InterruptFlag()};
  int status = 0;
  if (app.got_subcommand("solve")) {
    status = RunSolve(solve, task, std::cout, std::cerr);
  } else if (app.got_subcommand("simulate")) {
    status = RunSimulate(simulate, task, std::cout, std::cerr);
  } else if (app.got_subcommand("calibrate")) {
    status = RunCalibrate(app, calibrate, task, std::cout, std::cerr);
  } else if (app.got_subcommand("board")) {
    status = RunBoardPrint(board_print, task, std::cout, std::cerr);
  } else if (app.got_subcommand("capture")) {
    status = RunCaptureCommand(capture, task, std::cout, std::cerr);
  } else if (app.got_subcommand("preview")) {
    status = RunPreview(preview, task, std::cout, std::cerr);
  } else if (app.got_subcommand("light")) {
    status = RunLight(light, task, std::cout, std::cerr);
  } else if (app.got_subcommand("devices")) {
    status = RunDevices(devices, task, std::cout, std::cerr);
  } else if (app.got_subcommand("serve")) {
    status = RunServe(serve, task, std::cout, std::cerr);
  } else if (app.got_subcommand("session")) {
    status = RunSession(app, session, task, std::cout, std::cerr);
  } else if (bench->got_subcommand("accuracy")) {
    status = RunBenchAccuracy(bench_accuracy, task, std::cout, std::cerr);
  } else if (bench->got_subcommand("simulate")) {
    status = RunBenchSimulate(bench_simulate, task, std::cout, std::cerr);
  } else if (bench->got_subcommand("calibrate")) {
    status = RunBenchCalibrate(bench_calibrate, task, std::cout, std::cerr);
  } else {
    status = RunBenchSolve(bench_solve, task, std::cout, std::cerr);
  }
  if (status == 0 && !std::cout.flush()) {
    std::cerr << "sateen: error: standard output cannot be written; is the disk full?\n";
    return kInputOutput;
  }
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::cerr << "sateen: error: out of memory; use smaller images or fewer lights at a time\n";
    return kInternal;
  } catch (const std::exception& error) {
    std::cerr << "sateen: internal error: " << error.what() << '\n';
    return kInternal;
  }
}
