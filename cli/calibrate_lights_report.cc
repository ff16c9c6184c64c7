#include "cli/calibrate_lights_report.h"

#include <nlohmann/json.hpp>

#include "core/angle.h"

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

const RungFit& ChosenRung(const LightFit& fit) {
  for (const RungFit& rung : fit.rungs) {
    if (rung.light.model == fit.light.model) {
      return rung;
    }
  }
  return fit.rungs.back();
}

}  // namespace

std::string JsonReport(const CalibrateLightsArgs& args, const LightsCalibration& result) {
  nlohmann::json report = {{"schema", "sateen.calibrate.lights/1"},
                           {"version", SATEEN_VERSION},
                           {"output", args.output.string()},
                           {"former_rig", result.former_rig.string()},
                           {"pictures", result.pictures.string()},
                           {"albedo", args.albedo},
                           {"seconds", result.seconds},
                           {"warnings", result.warnings},
                           {"inputs", result.sha256_of_input},
                           {"lights", nlohmann::json::array()}};
  for (const LightFigures& figures : result.lights) {
    report["lights"].push_back(FiguresOf(figures));
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateLightsArgs& args, const LightsCalibration& result) {
  std::string text = fmt::format("{:<10} {:<5} {:>9} {:>13} {:>14} {:>8} {:>15} {:>9}\n", "light",
                                 "model", "moved mm", "position +- mm", "direction +-", "flux +-",
                                 "misfit / noise", "left out");
  bool has_truth = false;
  for (const LightFigures& figures : result.lights) {
    const LightFit& fit = figures.fit;
    text += fmt::format(
        "{:<10} {:<5} {:>9.2f} {:>14.3f} {:>10.4f} deg {:>6.3f} % {:>15.2f} {:>7.1f} %\n",
        fit.light.name, Name(fit.light.model), figures.moved_mm, fit.position_sd_mm.norm(),
        fit.direction_sd_rad / kRadPerDeg, 100.0 * fit.flux_sd.maxCoeff(),
        ChosenRung(fit).held_out_rms / fit.noise_rms,
        100.0 * static_cast<double>(fit.left_out) / static_cast<double>(fit.left_out + fit.used));
    has_truth = has_truth || figures.position_error_mm.has_value();
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
