#include "cli/preview.h"

#include <CLI/CLI.hpp>
#include <ostream>

#include "cli/device_options.h"
#include "core/files/output_folder.h"
#include "core/quantity.h"

namespace sateen::cli {
namespace {

Result<PreviewRequest> PreviewRequestOf(const PreviewArgs& args) {
  PreviewRequest request = args.request;
  if (!args.light.empty()) {
    request.light = args.light;
  }
  if (args.exposure != "auto") {
    const Result<double> exposure_s = ParseExposure(args.exposure);
    if (!exposure_s) {
      return tl::unexpected(exposure_s.error());
    }
    request.exposure_s = *exposure_s;
  }
  const Result<double> level = ParseLevel(args.level);
  if (!level) {
    return tl::unexpected(level.error());
  }
  request.level = *level;
  return request.Validate().and_then([&] { return CheckPreviewName(args.output); }).map([&] {
    return request;
  });
}

int ReportPreview(const PreviewArgs& args, const Result<Preview>& preview, std::ostream& out,
                  std::ostream& log) {
  if (!preview) {
    log << "sateen preview: error: " << preview.error().message << '\n';
    return ExitStatus(preview.error());
  }
  out << fmt::format("{}: {}x{} px, {}, f/{:g}, ISO {:g}; peak at {:.0f} % of saturation\n",
                     args.output.string(), preview->size_px.width, preview->size_px.height,
                     ExposureText(preview->settings.exposure_s), preview->settings.f_number,
                     preview->settings.iso, 100.0 * preview->levels.peak);
  return 0;
}

}  // namespace

void AddPreview(CLI::App& root, PreviewArgs& args) {
  CLI::App* cmd = root.add_subcommand("preview",
                                      "Take one frame and write it as a JPEG to check framing, "
                                      "focus and exposure; saturated pixels "
                                      "are magenta");
  PreviewRequest& request = args.request;
  cmd->add_option(
         "-o,--output", args.output,
         "JPEG file, .jpg or .jpeg, of half the sensor's size, or smaller where that is wider "
         "than --max-width")
      ->capture_default_str();
  cmd->add_option("--light", args.light,
                  "Name (of --rig) or channel of the light that is on; default: room light alone");
  cmd->add_option("--rig", request.rig, "Rig file: names of lights, white balance");
  cmd->add_option("--exposure", args.exposure, "Exposure, as 1/50 or 20ms; auto: from test frames")
      ->capture_default_str();
  cmd->add_option("--aperture", request.f_number, "f-number")->capture_default_str();
  cmd->add_option("--iso", request.iso, "ISO")->capture_default_str();
  cmd->add_option("--level", args.level, "Level of the light, 0.1% to 100%")->capture_default_str();
  cmd->add_option("--max-width", request.max_width, "Widest picture, 16 to 16384 px")
      ->capture_default_str();
  AddDeviceOptions(*cmd, args.devices);
  cmd->final_callback([&args] {
    if (const Result<PreviewRequest> parsed = PreviewRequestOf(args); !parsed) {
      throw CLI::ValidationError(parsed.error().message);
    }
  });
}

int RunPreview(const PreviewArgs& args, const Task& task, std::ostream& out, std::ostream& log) {
  const Result<std::optional<DaemonClient>> daemon = DaemonFor(args.devices);
  if (!daemon || *daemon) {
    const Result<PreviewRequest> request =
        daemon ? PreviewRequestOf(args) : tl::unexpected(daemon.error());
    return ReportPreview(args,
                         request ? PreviewByDaemon(**daemon, *request, args.output, task)
                                 : tl::unexpected(request.error()),
                         out, log);
  }
  RigDevices devices(args.devices);
  return RunPreviewWith(args, devices, task, out, log);
}

int RunPreviewWith(const PreviewArgs& args, RigDevices& devices, const Task& task,
                   std::ostream& out, std::ostream& log) {
  return ReportPreview(args,
                       PreviewRequestOf(args)
                           .and_then([&](const PreviewRequest& request) {
                             return TakePreview(request, devices, task);
                           })
                           .and_then([&](Preview preview) {
                             return WriteFileWhole(args.output, preview.jpeg).map([&] {
                               return std::move(preview);
                             });
                           }),
                       out, log);
}

}  // namespace sateen::cli
