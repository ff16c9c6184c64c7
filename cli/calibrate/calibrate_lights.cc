#include "cli/calibrate/calibrate_lights.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cli/calibrate/calibration_report.h"
#include "cli/choice.h"
#include "core/angle.h"

namespace sateen::cli {
namespace {

// Returns a line per sheet, and an empty one; "" without any.
std::string SheetsTable(const std::vector<SheetFigures>& sheets) {
  if (sheets.empty()) {
    return "";
  }
  std::string text =
      fmt::format("{:<28} {:>8} {:>19} {:>23} {:>15} {:>7}\n", "sheet, by its border", "markers",
                  "tilt +- deg", "x, y, z +- mm", "off the truth", "misfit");
  for (const SheetFigures& figures : sheets) {
    const SheetPose& pose = figures.pose;
    const Eigen::Vector3d at = pose.table_from_sheet.translation();
    const std::string off = figures.tilt_error_deg
                                ? fmt::format("{:.4f} deg", *figures.tilt_error_deg)
                                : std::string("-");
    text += fmt::format(
        "{:<28} {:>8} {:>9.4f} +- {:.4f} {:>6.1f} {:>5.1f} {:>5.1f} +- {:.3f} {:>14} {:>5.1f} %\n",
        std::filesystem::path(figures.name).filename().string(),
        fmt::format("{} of {}", pose.markers_used, pose.markers), TiltDeg(pose), TiltSdDeg(pose),
        at.x(), at.y(), at.z(), pose.position_sd_mm.norm(), off, 100.0 * pose.misfit);
  }
  return text + "\n";
}

// Returns how flat the sheets solve, one line per way to calibrate.
std::string WaysTable(const std::vector<WayFigures>& ways) {
  const auto cell = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.3f} deg", *value) : std::string("-");
  };
  std::string text = fmt::format("\n{:<32} {:>14} {:>14} {:>16}\n", "off by, edge to edge",
                                 "flat sheet", "tilted sheets", "lights, truth");
  for (const WayFigures& way : ways) {
    text += fmt::format("{:<32} {:>14} {:>14} {:>16}\n", way.label, cell(way.flat_deg),
                        cell(way.tilted_deg), cell(way.direction_error_deg));
  }
  return text + "\n";
}

// Returns each rung's misfit of held-out samples over the noise: "near 75.1, led 1.01".
std::string RungsOf(const LightFit& fit) {
  std::vector<std::string> rungs;
  for (const RungFit& rung : fit.rungs) {
    rungs.push_back(
        fmt::format("{} {:.3g}", Name(rung.light.model), rung.held_out_rms / fit.noise_rms));
  }
  return fmt::format("{}", fmt::join(rungs, ", "));
}

std::string WorstErrors(const std::vector<LightFigures>& lights) {
  double position_mm = 0.0;
  double direction_deg = 0.0;
  double flux = 0.0;
  for (const LightFigures& figures : lights) {
    position_mm = std::max(position_mm, figures.position_error_mm.value_or(0.0));
    direction_deg = std::max(direction_deg, figures.direction_error_deg.value_or(0.0));
    flux = std::max(flux, figures.flux_error.value_or(0.0));
  }
  return fmt::format(
      "worst error against truth/rig.json: position {:.3g} mm, direction {:.3g} degrees, flux "
      "{:.3g} %\n",
      position_mm, direction_deg, 100.0 * flux);
}

std::string TextReport(const LightsCalibration& result) {
  std::string text = SheetsTable(result.sheets);
  text += fmt::format("{:<10} {:<9} {:>9} {:>14} {:>14} {:>8} {:>9}  {}\n", "light", "model",
                      "moved mm", "position +- mm", "direction +-", "flux +-", "left out",
                      "misfit / noise");
  bool has_truth = false;
  for (const LightFigures& figures : result.lights) {
    const LightFit& fit = figures.fit;
    text += fmt::format(
        "{:<10} {:<9} {:>9.2f} {:>14.3f} {:>10.4f} deg {:>6.3f} % {:>7.1f} %  {}\n", fit.light.name,
        Name(fit.light.model), figures.moved_mm, fit.position_sd_mm.norm(),
        fit.direction_sd_rad / kRadPerDeg, 100.0 * fit.flux_sd.maxCoeff(),
        100.0 * static_cast<double>(fit.left_out) / static_cast<double>(fit.left_out + fit.used),
        RungsOf(fit));
    has_truth = has_truth || figures.position_error_mm.has_value();
  }
  text += WaysTable(result.ways);
  if (!result.ways.empty() && result.ways.back().flat_deg) {
    text += fmt::format("the flat sheet solves flat to {:.3f} degrees edge to edge\n",
                        *result.ways.back().flat_deg);
  }
  if (has_truth) {
    text += WorstErrors(result.lights);
  }
  return text + FilesText(result, (result.pictures / "residuals.png").string());
}

}  // namespace

void AddCalibrateLights(CLI::App& calibrate, CalibrateLightsArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "lights", "Positions and intensities of the lights from sheets of white paper");
  CalibrateLightsOptions& options = args.options;
  cmd->add_option(
         "--sheet", options.sheets,
         "Sessions of white sheets: the flat one first, then tilted ones, if there are any")
      ->required();
  cmd->add_option("-o,--output", options.output,
                  "Rig file to write; one that exists is kept as a copy")
      ->required();
  CLI::Option* border =
      cmd->add_option("--border", options.border,
                      "Marker border printed on the sheets, such as sheet:A4:12mm (sateen board "
                      "print); gives their poses where sessions have no table_from_sheet");
  cmd->add_flag("--find-poses", options.find_poses,
                "Find poses by the border also where sessions have table_from_sheet")
      ->needs(border);
  cmd->add_option("--rig", options.rough_rig,
                  "Rough rig: camera, and lights to within some 50 mm; default: the one at "
                  "--output, or else the session's own");
  AddChoice(*cmd, "--model", "Highest rung of the model ladder: near, led or led+field",
            {LightModel::kNear, LightModel::kLed, LightModel::kLedField}, options.highest_rung);
  cmd->add_option("--albedo", options.albedo, "Albedo of the paper (0, 1]")->capture_default_str();
  AddThreadsAndJson(*cmd, args.threads, args.json);
}

int RunCalibrateLights(const CalibrateLightsArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log) {
  const Result<LightsCalibration> result =
      CalibrateLightsFromSheets(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("lights", args.json, result, TextReport, out, log);
}

}  // namespace sateen::cli
