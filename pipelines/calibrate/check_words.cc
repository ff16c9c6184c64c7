#include "pipelines/calibrate/check_words.h"

#include <algorithm>
#include <cmath>

namespace sateen {
namespace {

// Returns "79.8 %", or the percent of each channel where they differ by more than 0.5.
std::string FluxWords(const Eigen::Vector3d& ratio) {
  const Eigen::Vector3d percent = 100.0 * ratio;
  if (percent.maxCoeff() - percent.minCoeff() < 0.5) {
    return fmt::format("{:.1f} %", percent.mean());
  }
  return fmt::format("{:.1f}, {:.1f}, {:.1f} % (red, green, blue)", percent[0], percent[1],
                     percent[2]);
}

std::string MoveWords(const Eigen::Vector3d& mm) {
  return fmt::format("{:.1f} mm (x {:+.1f}, y {:+.1f}, z {:+.1f})", mm.norm(), mm.x(), mm.y(),
                     mm.z());
}

std::string WhatIsWrong(const Rig& rig, size_t k, const LightCheck& light) {
  const std::string& name = rig.lights[k].name;
  switch (light.verdict) {
    case LightVerdict::kHolds:
      return "";
    case LightVerdict::kDark:
      return fmt::format("{}: dark: it did not light; look at its cable and LED", name);
    case LightVerdict::kSaturated:
      return fmt::format("{}: saturated: expose for less and capture the sheet again", name);
    case LightVerdict::kElsewhere:
      return fmt::format("{}: its frame is lit from where {} is; are frames or cables swapped?",
                         name, rig.lights[*light.lit_from].name);
    case LightVerdict::kMoved:
      return fmt::format(
          "{}: moved {}: {:.2f} degrees over the field{}; put it back, or calibrate lights again",
          name, MoveWords(light.moved_mm), light.direction_deg,
          light.is_flux_off ? fmt::format(", at {} of its flux", FluxWords(light.flux_ratio)) : "");
    case LightVerdict::kTurned:
      return fmt::format("{}: turned by {:.1f} degrees; turn it back, or calibrate lights again",
                         name, light.turned_deg);
    case LightVerdict::kDim:
      return fmt::format("{}: {} of its flux: dim; wipe it, or calibrate lights again", name,
                         FluxWords(light.flux_ratio));
    case LightVerdict::kBright:
      return fmt::format("{}: {} of its flux: bright; calibrate lights again", name,
                         FluxWords(light.flux_ratio));
  }
  return "";
}

std::string CameraWords(const Rig& rig, const CameraCheck& camera) {
  const Camera& lens = *rig.camera;
  const double px_per_mm = lens.fx / std::abs(lens.table_from_camera.translation().z());
  return fmt::format(
      "camera: moved {}, turned {:.2f} degrees: the picture is off by {:.1f} px in the middle; "
      "calibrate pose again (or all lights together have moved the other way)",
      MoveWords(camera.moved_mm), camera.turned_deg, px_per_mm * camera.moved_mm.head<2>().norm());
}

void SaySheets(const CalibrationCheckOptions& options, CalibrationCheck& result) {
  for (size_t s = 0; s < result.check.sheets.size(); ++s) {
    const SheetSurface& sheet = result.check.sheets[s];
    const std::string where = options.sheets[s].string();
    if (sheet.slope_deg > options.check.max_sheet_deg) {
      result.faults.push_back(
          fmt::format("{}: the sheet slopes by {:.2f} degrees and lies up to {:.1f} mm off; lay it "
                      "flat, or level the table under the lights",
                      where, sheet.slope_deg, sheet.height_mm));
    }
    const double spoilt = 100.0 * (sheet.spots + sheet.folds);
    if (spoilt > 0.2) {
      const std::string words = fmt::format(
          "{}: {:.1f} % of the field has spots or no paper and {:.1f} % folds{}; left out{}", where,
          100.0 * sheet.spots, 100.0 * sheet.folds,
          sheet.folds > 0.0 ? fmt::format(" up to {:.1f} degrees", sheet.steepest_deg) : "",
          options.border.empty() && spoilt > options.check.max_spoilt_percent
              ? "; another sheet, or name a printed border with --border"
              : "");
      (spoilt > options.check.max_spoilt_percent ? result.faults : result.notes).push_back(words);
    }
  }
}

}  // namespace

void SayWhatIsWrong(const CalibrationCheckOptions& options, CalibrationCheck& result) {
  bool is_unclear = false;
  double direction_sd_deg = 0.0;
  for (size_t k = 0; k < result.check.lights.size(); ++k) {
    const LightCheck& light = result.check.lights[k];
    if (std::string words = WhatIsWrong(result.rig, k, light); !words.empty()) {
      result.faults.push_back(std::move(words));
    }
    is_unclear = is_unclear || light.is_unclear;
    direction_sd_deg = std::max(direction_sd_deg, light.direction_sd_deg);
  }
  if (result.check.camera.has_moved) {
    result.faults.push_back(CameraWords(result.rig, result.check.camera));
  }
  if (result.check.is_common_flux_off) {
    result.faults.push_back(fmt::format(
        "all lights: {} of their flux; another paper, exposure or supply? Normals stay right, "
        "albedo does not",
        FluxWords(result.check.common_flux)));
  }
  SaySheets(options, result);
  if (std::abs(result.ambient_percent) > options.max_ambient_percent) {
    result.faults.push_back(fmt::format(
        "dark frame: {:.1f} % of the dimmest light; {}", result.ambient_percent,
        result.ambient_percent > 0.0 ? "switch off the room's lights or draw the curtains"
                                     : "the black level has changed; calibrate response again"));
  }
  if (is_unclear) {
    result.notes.push_back(
        fmt::format("directions that changed by less than {:.2g} degrees would go unseen ({:g} "
                    "standard deviations; the limit is {:g}); tilted sheets (--sheet) or more "
                    "pixels show smaller moves",
                    options.check.significance * direction_sd_deg, options.check.significance,
                    options.check.max_direction_deg));
  }
}

}  // namespace sateen
