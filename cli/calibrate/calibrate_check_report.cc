#include "cli/calibrate/calibrate_check_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/version.h"
#include "imaging/show/canvas.h"

namespace sateen::cli {
namespace {

constexpr double kShown = 0.02;  // of the ratio, at full colour
constexpr int kRatioPanelPx = 240;
constexpr int kColumns = 5;
constexpr uint8_t kNothing = 96;

nlohmann::json ToJson(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

// "79.8 %", or each channel's where they differ by more than half a per cent.
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

void SaySheets(const CalibrateCheckArgs& args, CalibrationCheck& result) {
  for (size_t s = 0; s < result.check.sheets.size(); ++s) {
    const SheetSurface& sheet = result.check.sheets[s];
    const std::string where = args.sheets[s].string();
    if (sheet.slope_deg > args.options.max_sheet_deg) {
      result.faults.push_back(
          fmt::format("{}: the sheet slopes by {:.2f} degrees and lies up to {:.1f} mm off; lay it "
                      "flat, or the "
                      "table tilts under the lights",
                      where, sheet.slope_deg, sheet.height_mm));
    }
    const double spoilt = 100.0 * (sheet.spots + sheet.folds);
    if (spoilt > 0.2) {
      const std::string words = fmt::format(
          "{}: {:.1f} % of the field has spots or no paper and {:.1f} % folds{}; left out{}", where,
          100.0 * sheet.spots, 100.0 * sheet.folds,
          sheet.folds > 0.0 ? fmt::format(" up to {:.1f} degrees", sheet.steepest_deg) : "",
          args.border.empty() && spoilt > args.options.max_spoilt_percent
              ? "; another sheet, or name a printed border with --border"
              : "");
      (spoilt > args.options.max_spoilt_percent ? result.faults : result.notes).push_back(words);
    }
  }
}

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

// Light grey, to red above and to blue below.
std::array<uint8_t, 3> Colour(double off) {
  const double t = std::clamp(off / kShown, -1.0, 1.0);
  const auto towards = [&](double end) {
    return static_cast<uint8_t>(std::lround(std::lerp(225.0, end, std::abs(t))));
  };
  return t >= 0.0 ? std::array<uint8_t, 3>{towards(200.0), towards(0.0), towards(0.0)}
                  : std::array<uint8_t, 3>{towards(0.0), towards(40.0), towards(200.0)};
}

}  // namespace

void SayWhatIsWrong(const CalibrateCheckArgs& args, CalibrationCheck& result) {
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
        "all lights: {} of their flux; another paper, exposure or supply? Normals do not feel it, "
        "albedo does",
        FluxWords(result.check.common_flux)));
  }
  SaySheets(args, result);
  if (std::abs(result.ambient_percent) > args.max_ambient_percent) {
    result.faults.push_back(fmt::format(
        "dark frame: {:.1f} % of the dimmest light; {}", result.ambient_percent,
        result.ambient_percent > 0.0 ? "switch off the room's lights or draw the curtains"
                                     : "the black level has changed; calibrate response again"));
  }
  if (is_unclear) {
    result.notes.push_back(
        fmt::format("directions that changed by less than {:.2g} degrees would go unseen ({:g} "
                    "standard deviations; the limit is {:g}); tilted sheets (--sheet) or more "
                    "pixels see smaller moves",
                    args.options.significance * direction_sd_deg, args.options.significance,
                    args.options.max_direction_deg));
  }
}

std::string JsonReport(const CalibrateCheckArgs& args, const CalibrationCheck& result) {
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
                            {{"albedo", args.options.albedo},
                             {"max_direction_deg", args.options.max_direction_deg},
                             {"max_flux_percent", args.options.max_flux_percent},
                             {"max_common_flux_percent", args.options.max_common_flux_percent},
                             {"max_sheet_deg", args.options.max_sheet_deg},
                             {"max_spoilt_percent", args.options.max_spoilt_percent},
                             {"max_ambient_percent", args.max_ambient_percent},
                             {"significance", args.options.significance}}},
                           {"seconds", result.seconds},
                           {"inputs", result.sha256_of_input}};
  for (size_t k = 0; k < result.check.lights.size(); ++k) {
    report["lights"].push_back(LightJson(result.rig, k, result.check.lights[k]));
  }
  for (size_t s = 0; s < result.check.sheets.size(); ++s) {
    const SheetSurface& sheet = result.check.sheets[s];
    report["sheets"].push_back({{"sheet", args.sheets[s].string()},
                                {"slope_deg", sheet.slope_deg},
                                {"height_mm", sheet.height_mm},
                                {"spots_percent", 100.0 * sheet.spots},
                                {"folds_percent", 100.0 * sheet.folds},
                                {"steepest_fold_deg", sheet.steepest_deg}});
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateCheckArgs& args, const CalibrationCheck& result) {
  std::string text =
      fmt::format("{:<12} {:<10} {:>7} {:>7} {:>7} {:>8} {:>9} {:>12} {:>12}\n", "light", "verdict",
                  "red %", "green %", "blue %", "+- %", "moved mm", "direction", "+-");
  for (size_t k = 0; k < result.check.lights.size(); ++k) {
    const LightCheck& light = result.check.lights[k];
    text += fmt::format("{:<12} {:<10}", result.rig.lights[k].name, Name(light.verdict));
    const bool is_known = light.verdict != LightVerdict::kDark &&
                          light.verdict != LightVerdict::kSaturated &&
                          light.verdict != LightVerdict::kElsewhere;
    text += !is_known ? "\n"
                      : fmt::format(
                            " {:>7.2f} {:>7.2f} {:>7.2f} {:>8.3f} {:>9.2f} {:>8.3f} deg "
                            "{:>8.4f} deg\n",
                            100.0 * light.flux_ratio[0], 100.0 * light.flux_ratio[1],
                            100.0 * light.flux_ratio[2], 100.0 * light.flux_sd.maxCoeff(),
                            light.moved_mm.norm(), light.direction_deg, light.direction_sd_deg);
  }
  const Eigen::Vector3d& common = result.check.common_flux;
  text += fmt::format("all lights together: {:.2f}, {:.2f}, {:.2f} % of their flux\n",
                      100.0 * common[0], 100.0 * common[1], 100.0 * common[2]);
  for (const std::string& fault : result.faults) {
    text += fault + "\n";
  }
  const bool is_unclear = std::ranges::any_of(result.check.lights, &LightCheck::is_unclear);
  text += result.faults.empty()
              ? fmt::format("the calibration holds{}\n",
                            is_unclear ? ", as far as these sheets can tell (see the note)" : "")
              : fmt::format("the calibration does not hold: {} fault{}\n", result.faults.size(),
                            result.faults.size() == 1 ? "" : "s");
  if (!args.output.empty()) {
    text += fmt::format("look at {}\n", (args.output / "ratio.png").string());
  }
  return text;
}

Rgb8 RatioPicture(const CalibrationCheck& result, size_t sheet, const SheetReadings& view) {
  std::vector<Rgb8> panels;
  for (size_t k = 0; k < view.samples.size(); ++k) {
    Rgb8 panel;
    panel.fill(Image<uint8_t>(view.columns, view.rows, kNothing));
    for (size_t j = 0; j < view.blocks[k].size(); ++j) {
      const double ratio = result.check.ratios[sheet][k][j] / result.check.common_flux[1];
      const std::array<uint8_t, 3> colour = Colour(ratio - 1.0);
      for (size_t c = 0; c < 3; ++c) {
        panel[c].pixels[static_cast<size_t>(view.blocks[k][j])] = colour[c];
      }
    }
    panels.push_back(Captioned(Enlarged(panel, kRatioPanelPx / view.columns),
                               fmt::format("{}: {}, +-{:g} %", result.rig.lights[k].name,
                                           Name(result.check.lights[k].verdict), 100.0 * kShown)));
  }
  return ContactSheet(panels, kColumns);
}

}  // namespace sateen::cli
