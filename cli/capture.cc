#include "cli/capture.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <ostream>
#include <utility>

#include "cli/device_options.h"
#include "core/quantity.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

// The words of the command line as a request. Each has been checked when it was parsed.
Result<CaptureRequest> RequestOf(const CaptureArgs& args) {
  CaptureRequest request = args.request;
  CaptureOptions& options = request.options;
  request.resume = !args.resume.empty();
  if (request.resume) {
    request.output = args.resume;
    request.new_exposure = !args.exposure.empty();
  }
  options.kind = args.sheet ? SessionKind::kSheet : SessionKind::kFabric;
  if (!args.exposure.empty() && args.exposure != "auto") {
    const Result<double> exposure_s = ParseExposure(args.exposure);
    if (!exposure_s) {
      return tl::unexpected(exposure_s.error());
    }
    options.exposure_s = *exposure_s;
  }
  const Result<double> level = ParseLevel(args.level);
  if (!level) {
    return tl::unexpected(level.error());
  }
  options.level = *level;
  for (const auto& [text, time] :
       {std::pair{&args.settle, &options.settle}, std::pair{&args.margin, &options.margin},
        std::pair{&args.deadline, &options.deadline}}) {
    const Result<std::chrono::milliseconds> parsed = ParseDuration(*text);
    if (!parsed) {
      return tl::unexpected(parsed.error());
    }
    *time = *parsed;
  }
  return options.Validate().map([&] { return std::move(request); });
}

// "led-3, 1/60 s, peak 78 %, 9 s left"
std::string StageText(const CaptureEvent& event) {
  if (event.light.empty()) {
    return event.stage;
  }
  std::string text = event.stage == "metering" ? "metering " + event.light : event.light;
  text += ", " + ExposureText(event.exposure_s);
  if (event.peak > 0.0) {
    text += fmt::format(", last peak {:.0f} %", 100.0 * event.peak);
  }
  if (event.left_s) {
    text += fmt::format(", {:.0f} s left", *event.left_s);
  }
  return text;
}

CaptureObserver ShowOn(const Task& task) {
  return [&task](const CaptureEvent& event) {
    if (event.stage == "capturing" && event.light.empty()) {
      return;  // a frame counts; the next event names the light that is on
    }
    task.BeginStage(StageText(event), static_cast<int>(event.frames));
    task.Advance(static_cast<int>(event.done));
  };
}

int Report(const Error& error, std::ostream& log) {
  log << "sateen capture: error: " << error.message << '\n';
  return ExitStatus(error);
}

int ReportForecast(const CaptureArgs& args, const Result<CaptureForecast>& forecast,
                   std::ostream& out, std::ostream& log) {
  if (!forecast) {
    return Report(forecast.error(), log);
  }
  out << (args.json ? ForecastJson(*forecast) : ForecastText(*forecast));
  return 0;
}

int ReportCapture(const CaptureArgs& args, const CaptureRequest& request,
                  const Result<CaptureSummary>& summary, const Task& task, std::ostream& out,
                  std::ostream& log) {
  task.ClearProgress();
  const Result<Rig> rig =
      summary ? ReadRig(request.output / summary->session.rig) : tl::unexpected(summary.error());
  if (!rig) {
    return Report(rig.error(), log);
  }
  out << (args.json ? CaptureJson(request.output, *rig, *summary)
                    : CaptureText(request.output, *rig, *summary));
  return 0;
}

}  // namespace

void AddCapture(CLI::App& root, CaptureArgs& args) {
  CLI::App* cmd = root.add_subcommand(
      "capture",
      "Capture a session: a dark frame, a frame under each light, the first light again, a second "
      "dark frame; every frame is checked");
  CLI::Option* resume =
      cmd->add_option("--resume", args.resume,
                      "Continue this session after a crash, a power cut or Ctrl-C: complete frames "
                      "are kept");
  CLI::Option* rig = cmd->add_option("--rig", args.request.rig, "Rig file")->excludes(resume);
  CLI::Option* output =
      cmd->add_option("-o,--output", args.request.output, "Folder for the session")
          ->excludes(resume);
  CaptureOptions& options = args.request.options;
  cmd->add_flag("--sheet", args.sheet,
                "The object is a sheet of white paper for calibrating the lights")
      ->excludes(resume);
  cmd->add_option(
      "--exposure", args.exposure,
      "Exposure of each frame, as 1/50 or 20ms. auto, the default: from test frames of the "
      "brightest light, and several per light where one cannot cover the scene. With "
      "--resume: take every frame again, at this exposure");
  cmd->add_option("--aperture", options.f_number, "f-number")
      ->capture_default_str()
      ->excludes(resume);
  cmd->add_option("--iso", options.iso, "ISO")->capture_default_str()->excludes(resume);
  cmd->add_option("--level", args.level, "Level of the lights, 0.1% to 100%")
      ->capture_default_str()
      ->excludes(resume);
  cmd->add_option("--brackets", options.brackets,
                  "Most exposures per light with --exposure auto, 1 to 3")
      ->capture_default_str()
      ->excludes(resume);
  AddDeviceOptions(*cmd, args.devices);
  cmd->add_option("--tries", options.tries, "Attempts per frame before the capture stops")
      ->capture_default_str();
  cmd->add_option("--settle", args.settle, "Time from turning a light on to the exposure")
      ->capture_default_str();
  cmd->add_option("--margin", args.margin,
                  "Time beyond the exposure for which a light may stay on, until the camera has "
                  "delivered the frame")
      ->capture_default_str();
  cmd->add_option("--deadline", args.deadline, "Longest wait for a frame beyond its exposure")
      ->capture_default_str();
  cmd->add_flag(
         "--dry-run", args.dry_run,
         "Check whether the capture can begin and report what it would do; takes no frame and "
         "writes no file")
      ->excludes(resume);
  cmd->add_flag("--json", args.json, "Print JSON");
  cmd->final_callback([&args, rig, output] {
    if (args.resume.empty() && (rig->count() == 0 || output->count() == 0)) {
      throw CLI::ValidationError("needs --rig and --output, or --resume SESSION");
    }
    if (const Result<CaptureRequest> request = RequestOf(args); !request) {
      throw CLI::ValidationError(request.error().message);
    }
  });
}

int RunCaptureCommand(const CaptureArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log) {
  const Result<std::optional<DaemonClient>> daemon = DaemonFor(args.devices);
  if (!daemon) {
    return Report(daemon.error(), log);
  }
  if (*daemon) {
    return RunCaptureByDaemon(args, **daemon, task, out, log);
  }
  RigDevices devices(args.devices);
  return RunCaptureWith(args, devices, task, out, log);
}

int RunCaptureByDaemon(const CaptureArgs& args, const DaemonClient& daemon, const Task& task,
                       std::ostream& out, std::ostream& log) {
  const Result<CaptureRequest> request = RequestOf(args);
  if (!request) {
    return Report(request.error(), log);
  }
  if (args.dry_run) {
    return ReportForecast(args, ForecastByDaemon(daemon, *request), out, log);
  }
  return ReportCapture(args, *request, CaptureByDaemon(daemon, *request, task, ShowOn(task)), task,
                       out, log);
}

int RunCaptureWith(const CaptureArgs& args, RigDevices& devices, const Task& task,
                   std::ostream& out, std::ostream& log) {
  const Result<CaptureRequest> request = RequestOf(args);
  if (!request) {
    return Report(request.error(), log);
  }
  if (args.dry_run) {
    return ReportForecast(args, ForecastCapture(*request, devices), out, log);
  }
  return ReportCapture(args, *request, RunCapture(*request, devices, task, ShowOn(task)), task, out,
                       log);
}

}  // namespace sateen::cli
