#include "cli/calibrate/calibrate_spheres.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cli/calibrate/calibration_report.h"
#include "cli/choice.h"
#include "core/angle.h"
#include "imaging/encoding_name.h"
#include "pipelines/calibrate/spheres_record.h"

namespace sateen::cli {
namespace {

std::string SphereLines(const SpheresCalibration& result) {
  std::string text;
  for (size_t j = 0; j < result.spheres.size(); ++j) {
    const Sphere& sphere = result.spheres[j];
    text += fmt::format("sphere {}: centre ({:.2f}, {:.2f}) px, radius {:.2f} px, by {}", j + 1,
                        sphere.outline.center_px.x(), sphere.outline.center_px.y(),
                        sphere.outline.radius_px, result.outlines);
    text += sphere.seen > 0.0
                ? fmt::format("; {:.0f} % of the outline seen, edges within {:.2f} px\n",
                              100.0 * sphere.seen, sphere.residual_px)
                : "\n";
  }
  return text;
}

std::string TextReport(const SpheresCalibration& result) {
  std::string text = SphereLines(result);
  size_t width = 8;
  for (const LampFigures& figures : result.lights) {
    width = std::max(width, figures.lamp.light.name.size());
  }
  text += fmt::format("{:>3} {:<{}}  {:^26} {:>9} {:>8} {:>7} {:>10}  {}\n", "no.", "light", width,
                      "direction", "elevation", "azimuth", "spheres", "disagree", "position +- mm");
  for (size_t k = 0; k < result.lights.size(); ++k) {
    const LampFigures& figures = result.lights[k];
    const Eigen::Vector3d l = figures.Direction();
    const SkyPlace place = PlaceInSky(l);
    text += fmt::format("{:>3} {:<{}}  {:>8.5f} {:>8.5f} {:>8.5f} {:>9.2f} {:>8.2f} {:>7} ", k + 1,
                        figures.lamp.light.name, width, l.x(), l.y(), l.z(), place.elevation_deg,
                        place.azimuth_deg, figures.spheres_used);
    text += figures.spheres_used > 1
                ? fmt::format("{:>6.2f} deg", figures.lamp.residual_rad / kRadPerDeg)
                : fmt::format("{:>10}", "-");
    if (figures.lamp.position_sd_mm) {
      const Eigen::Vector3d& s = figures.lamp.light.position_mm;
      text += fmt::format("  ({:.1f}, {:.1f}, {:.1f}) +- {:.1f}", s.x(), s.y(), s.z(),
                          figures.lamp.position_sd_mm->norm());
    }
    text += '\n';
  }
  text += "spheres do not tell intensities: flux_rgb is 1 where the rig did not give it\n";
  return text + FilesText(result, (result.pictures / "outlines.png").string());
}

}  // namespace

void AddCalibrateSpheres(CLI::App& calibrate, CalibrateSpheresArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "spheres", "Directions or positions of the lights from photographs of chrome spheres");
  CalibrateSpheresOptions& options = args.options;
  cmd->add_option("photos", options.photos,
                  "Folder of photographs in natural order, one per light; a session; an .lp file")
      ->required();
  cmd->add_option("-o,--output", options.output,
                  "Rig file to write, or a list of directions for RTI if it ends in .lp; one that "
                  "exists is kept as a copy")
      ->required();
  cmd->add_option("--spheres", options.spheres, "Number of spheres; 0: as many as are found")
      ->check(CLI::Range(0, 16))
      ->capture_default_str();
  cmd->add_option("--rig", options.rig_file,
                  "Rig file with the camera's lens and pose, for the true perspective; default: "
                  "the session's own. Without one the view is orthographic");
  cmd->add_option("--radius", options.radius_mm,
                  "Radius of the spheres [mm]: two of them and the camera give positions")
      ->check(CLI::PositiveNumber);
  cmd->add_option("--reference", options.reference,
                  "Picture by room light for the outlines; default: ref.* in the folder, or else "
                  "the mean of all frames");
  CLI::Option* mask = cmd->add_option(
      "--mask", options.mask, "Image that is white in the spheres; default: the folder's own");
  cmd->add_option("--circles", options.circles,
                  "Outlines marked by hand: a line 'x y radius' in pixels per sphere, y down from "
                  "0; or three lines x, y, radius, 1-based and y up")
      ->excludes(mask);
  AddChoice(*cmd, "--highlight",
            "Centre of a highlight: lamp, of its bright core; median, of all pixels of the sphere "
            "from 250 of 255 on, as in older toolboxes",
            {HighlightCenter::kLamp, HighlightCenter::kMedian}, options.highlight);
  AddChoice(*cmd, "--encoding",
            "Encoding of integer files; auto: 8 bits are sRGB, 16 bits are linear",
            {Encoding::kAuto, Encoding::kLinear, Encoding::kSrgb}, options.encoding);
  AddThreadsAndJson(*cmd, args.threads, args.json);
}

int RunCalibrateSpheres(const CalibrateSpheresArgs& args, const Task& task, std::ostream& out,
                        std::ostream& log) {
  const Result<SpheresCalibration> result =
      CalibrateLightsFromSpheres(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("spheres", args.json, result, TextReport, out, log);
}

}  // namespace sateen::cli
