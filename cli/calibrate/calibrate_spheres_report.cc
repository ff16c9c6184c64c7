#include "cli/calibrate/calibrate_spheres_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/angle.h"
#include "core/version.h"

namespace sateen::cli {
namespace {

nlohmann::json Numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

struct SkyPlace {
  double elevation_deg;
  double azimuth_deg;  // from x to the right towards y up, 0 to 360
};

SkyPlace PlaceInSky(const Eigen::Vector3d& l) {
  const double azimuth_deg = std::atan2(l.y(), l.x()) / kRadPerDeg;
  return {std::asin(l.z()) / kRadPerDeg, azimuth_deg < 0.0 ? azimuth_deg + 360.0 : azimuth_deg};
}

nlohmann::json SphereFigures(const Sphere& sphere, bool has_depth) {
  nlohmann::json json = {
      {"center_px", {sphere.outline.center_px.x(), sphere.outline.center_px.y()}},
      {"radius_px", sphere.outline.radius_px},
      {"outline_seen", sphere.seen},
      {"outline_rms_px", sphere.residual_px}};
  if (has_depth) {
    json["center_mm"] = Numbers(sphere.center);
  }
  return json;
}

nlohmann::json LightFiguresOf(const LampFigures& figures) {
  const Light& light = figures.lamp.light;
  const SkyPlace place = PlaceInSky(figures.Direction());
  nlohmann::json json = {{"name", light.name},
                         {"file", figures.file.string()},
                         {"model", Name(light.model)},
                         {"direction", Numbers(figures.Direction())},
                         {"elevation_deg", place.elevation_deg},
                         {"azimuth_deg", place.azimuth_deg},
                         {"spheres", figures.spheres_used},
                         {"highlights_px", nlohmann::json::array()}};
  for (const std::optional<Highlight>& highlight : figures.highlights) {
    json["highlights_px"].push_back(
        highlight ? nlohmann::json({highlight->at_px.x(), highlight->at_px.y()})
                  : nlohmann::json(nullptr));
  }
  if (figures.spheres_used > 1) {
    json["disagreement_deg"] = figures.lamp.residual_rad / kRadPerDeg;
  }
  if (figures.lamp.position_sd_mm) {
    json["position_mm"] = Numbers(light.position_mm);
    json["position_sd_mm"] = Numbers(*figures.lamp.position_sd_mm);
  }
  return json;
}

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

}  // namespace

std::string JsonReport(const CalibrateSpheresArgs& args, const SpheresCalibration& result) {
  nlohmann::json report = {{"schema", "sateen.calibrate.spheres/1"},
                           {"version", Version()},
                           {"output", args.output.string()},
                           {"former_output", result.former_output.string()},
                           {"pictures", result.pictures.string()},
                           {"projection", result.rig.camera ? "perspective" : "orthographic"},
                           {"highlight", args.highlight},
                           {"outlines", result.outlines},
                           {"seconds", result.seconds},
                           {"warnings", result.warnings},
                           {"inputs", result.sha256_of_input},
                           {"spheres", nlohmann::json::array()},
                           {"lights", nlohmann::json::array()}};
  if (args.radius_mm > 0.0) {
    report["radius_mm"] = args.radius_mm;
  }
  for (const Sphere& sphere : result.spheres) {
    report["spheres"].push_back(
        SphereFigures(sphere, result.rig.camera.has_value() && args.radius_mm > 0.0));
  }
  for (const LampFigures& figures : result.lights) {
    report["lights"].push_back(LightFiguresOf(figures));
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateSpheresArgs& args, const SpheresCalibration& result) {
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
  text += "spheres say nothing of intensities: flux_rgb is 1 where the rig did not know it\n";
  if (!result.former_output.empty()) {
    text += fmt::format("the former file is kept as {}\n", result.former_output.string());
  }
  text += fmt::format("{} is written after {:.1f} s; look at {}\n", args.output.string(),
                      result.seconds, (result.pictures / "outlines.png").string());
  return text;
}

}  // namespace sateen::cli
