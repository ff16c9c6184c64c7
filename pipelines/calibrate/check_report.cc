#include "pipelines/calibrate/check_report.h"

#include <nlohmann/json.hpp>

#include "core/json.h"
#include "core/version.h"

namespace sateen {
namespace {

nlohmann::json ToJson(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

nlohmann::json LightJson(const Rig& rig, size_t k, const LightCheck& light) {
  nlohmann::json json = {{"name", rig.lights[k].name},
                         {"verdict", Name(light.verdict)},
                         {"flux_ratio", ToJson(light.flux_ratio)},
                         {"flux_sd", ToJson(light.flux_sd)},
                         {"moved_mm", ToJson(light.moved_mm)},
                         {"moved_sd_mm", ToJson(light.moved_sd_mm)},
                         {"direction_deg", light.direction_deg},
                         {"direction_sd_deg", light.direction_sd_deg},
                         {"turned_deg", light.turned_deg},
                         {"unclear", light.is_unclear}};
  if (light.lit_from) {
    json["lit_from"] = rig.lights[*light.lit_from].name;
  }
  return json;
}

}  // namespace

std::string CheckToJson(const CalibrationCheckOptions& options, const CalibrationCheck& result) {
  const CameraCheck& camera = result.check.camera;
  nlohmann::json report = {{"schema", "sateen.calibrate.check/1"},
                           {"version", Version()},
                           {"holds", result.faults.empty()},
                           {"faults", result.faults},
                           {"notes", result.notes},
                           {"lights", nlohmann::json::array()},
                           {"camera",
                            {{"moved", camera.has_moved},
                             {"moved_mm", ToJson(camera.moved_mm)},
                             {"moved_sd_mm", ToJson(camera.moved_sd_mm)},
                             {"turned_deg", camera.turned_deg},
                             {"direction_deg", camera.direction_deg}}},
                           {"sheets", nlohmann::json::array()},
                           {"common_flux", ToJson(result.check.common_flux)},
                           {"ambient_percent", result.ambient_percent},
                           {"options",
                            {{"albedo", options.check.albedo},
                             {"max_direction_deg", options.check.max_direction_deg},
                             {"max_flux_percent", options.check.max_flux_percent},
                             {"max_common_flux_percent", options.check.max_common_flux_percent},
                             {"max_sheet_deg", options.check.max_sheet_deg},
                             {"max_spoilt_percent", options.check.max_spoilt_percent},
                             {"max_ambient_percent", options.max_ambient_percent},
                             {"significance", options.check.significance}}},
                           {"seconds", result.seconds},
                           {"inputs", result.sha256_of_input}};
  for (size_t k = 0; k < result.check.lights.size(); ++k) {
    report["lights"].push_back(LightJson(result.rig, k, result.check.lights[k]));
  }
  for (size_t s = 0; s < result.check.sheets.size(); ++s) {
    const SheetSurface& sheet = result.check.sheets[s];
    report["sheets"].push_back({{"sheet", options.sheets[s].string()},
                                {"slope_deg", sheet.slope_deg},
                                {"height_mm", sheet.height_mm},
                                {"spots_percent", 100.0 * sheet.spots},
                                {"folds_percent", 100.0 * sheet.folds},
                                {"steepest_fold_deg", sheet.steepest_deg}});
  }
  return JsonText(report);
}

}  // namespace sateen
