#include "cli/calibrate/calibrate_lights_report.h"

#include <nlohmann/json.hpp>

#include "core/angle.h"
#include "core/version.h"

namespace sateen::cli {
namespace {

nlohmann::json FiguresOf(const LightFigures& figures) {
  const LightFit& fit = figures.fit;
  nlohmann::json json = {
      {"name", fit.light.name},
      {"model", Name(fit.light.model)},
      {"moved_mm", figures.moved_mm},
      {"position_sd_mm", {fit.position_sd_mm[0], fit.position_sd_mm[1], fit.position_sd_mm[2]}},
      {"direction_sd_deg", fit.direction_sd_rad / kRadPerDeg},
      {"flux_sd", {fit.flux_sd[0], fit.flux_sd[1], fit.flux_sd[2]}},
      {"noise_rms", fit.noise_rms},
      {"samples", fit.used},
      {"samples_left_out", fit.left_out},
      {"rungs", nlohmann::json::array()}};
  for (const RungFit& rung : fit.rungs) {
    json["rungs"].push_back({{"model", Name(rung.light.model)},
                             {"held_out_rms", rung.held_out_rms},
                             {"residual_rms", rung.residual_rms},
                             {"iterations", rung.iterations}});
  }
  if (figures.position_error_mm) {
    json["position_error_mm"] = *figures.position_error_mm;
    json["direction_error_deg"] = *figures.direction_error_deg;
    json["flux_error"] = *figures.flux_error;
  }
  return json;
}

nlohmann::json FiguresOf(const WayFigures& way) {
  nlohmann::json json = {{"way", way.key}};
  const auto add = [&](std::string_view key, const std::optional<double>& value) {
    if (value) {
      json[std::string(key)] = *value;
    }
  };
  add("flat_sheet_deg", way.flat_deg);
  add("tilted_sheets_deg", way.tilted_deg);
  add("direction_error_deg", way.direction_error_deg);
  return json;
}

// How flat the sheets solve, one line for each way to calibrate.
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

// What each rung left of the held-out samples, in units of the noise: "near 75.1, led 1.01".
std::string RungsOf(const LightFit& fit) {
  std::vector<std::string> rungs;
  for (const RungFit& rung : fit.rungs) {
    rungs.push_back(
        fmt::format("{} {:.3g}", Name(rung.light.model), rung.held_out_rms / fit.noise_rms));
  }
  return fmt::format("{}", fmt::join(rungs, ", "));
}

}  // namespace

std::string JsonReport(const CalibrateLightsArgs& args, const LightsCalibration& result) {
  nlohmann::json report = {{"schema", "sateen.calibrate.lights/1"},
                           {"version", Version()},
                           {"output", args.output.string()},
                           {"former_rig", result.former_rig.string()},
                           {"pictures", result.pictures.string()},
                           {"albedo", args.albedo},
                           {"seconds", result.seconds},
                           {"warnings", result.warnings},
                           {"inputs", result.sha256_of_input},
                           {"sheets", SheetsJson(result.sheets)},
                           {"lights", nlohmann::json::array()}};
  for (const LightFigures& figures : result.lights) {
    report["lights"].push_back(FiguresOf(figures));
  }
  report["ways"] = nlohmann::json::array();
  for (const WayFigures& way : result.ways) {
    report["ways"].push_back(FiguresOf(way));
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateLightsArgs& args, const LightsCalibration& result) {
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
    double position_mm = 0.0;
    double direction_deg = 0.0;
    double flux = 0.0;
    for (const LightFigures& figures : result.lights) {
      position_mm = std::max(position_mm, figures.position_error_mm.value_or(0.0));
      direction_deg = std::max(direction_deg, figures.direction_error_deg.value_or(0.0));
      flux = std::max(flux, figures.flux_error.value_or(0.0));
    }
    text += fmt::format(
        "worst error against truth/rig.json: position {:.3g} mm, direction {:.3g} degrees, flux "
        "{:.3g} %\n",
        position_mm, direction_deg, 100.0 * flux);
  }
  if (!result.former_rig.empty()) {
    text += fmt::format("the former rig is kept as {}\n", result.former_rig.string());
  }
  text += fmt::format("{} is written after {:.1f} s; look at {}\n", args.output.string(),
                      result.seconds, (result.pictures / "residuals.png").string());
  return text;
}

}  // namespace sateen::cli
