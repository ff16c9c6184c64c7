#include "cli/calibrate/calibrate_check.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cli/calibrate/calibration_report.h"
#include "pipelines/calibrate/check_report.h"

namespace sateen::cli {
namespace {

std::string TextReport(const CalibrationCheckOptions& options, const CalibrationCheck& result) {
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
  if (!options.output.empty()) {
    text += fmt::format("see {}\n", (options.output / "ratio.png").string());
  }
  return text;
}

}  // namespace

void AddCalibrateCheck(CLI::App& calibrate, CalibrateCheckArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "check", "Whether the calibration still holds, from a sheet of white paper");
  CalibrationCheckOptions& options = args.options;
  cmd->add_option("--sheet", options.sheets,
                  "Session of a white sheet that lies flat; more, tilted ones show smaller moves")
      ->required();
  cmd->add_option("--rig", options.rig, "Rig to check; default: the session's own");
  cmd->add_option("--border", options.border,
                  "Marker border printed on the sheets, such as sheet:A4:12mm; gives their poses "
                  "where sessions have no table_from_sheet");
  cmd->add_option("-o,--output", options.output,
                  "Folder for ratio.png, today's paper over what the rig says, and check.json");
  cmd->add_option("--albedo", options.check.albedo, "Albedo of the paper (0, 1]")
      ->capture_default_str();
  cmd->add_option("--max-direction", options.check.max_direction_deg,
                  "Largest change of a light's direction over the field [degrees] (0, 90)")
      ->capture_default_str();
  cmd->add_option("--max-flux", options.check.max_flux_percent,
                  "Largest change of a light's flux relative to that of all lights [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-common-flux", options.check.max_common_flux_percent,
                  "Largest change of the flux of all lights together [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-sheet-slope", options.check.max_sheet_deg,
                  "Largest slope of the sheet against its recorded pose [degrees] (0, 45)")
      ->capture_default_str();
  cmd->add_option("--max-spoilt", options.check.max_spoilt_percent,
                  "Largest share of the field with spots, folds or no paper [%] (0, 100)")
      ->capture_default_str();
  cmd->add_option("--max-ambient", options.max_ambient_percent,
                  "Largest dark frame relative to the dimmest light [%] (0, 100)")
      ->check(CLI::Range(1e-6, 100.0))
      ->capture_default_str();
  cmd->add_option("--significance", options.check.significance,
                  "Standard deviations from which on a change counts [2, 100]")
      ->capture_default_str();
  AddThreadsAndJson(*cmd, args.threads, args.json);
  cmd->footer(
      "Exit status: 0 if the calibration holds as far as the sheets can tell, 3 if it does not.");
}

int RunCalibrateCheck(const CalibrateCheckArgs& args, const Task& task, std::ostream& out,
                      std::ostream& log) {
  const Result<CalibrationCheck> result =
      CheckCalibration(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  if (!result) {
    PrintLines("check", "error", {result.error().message}, log);
    return ExitStatus(result.error());
  }
  PrintLines("check", "note", result->notes, log);
  out << (args.json ? CheckToJson(args.options, *result) + "\n"
                    : TextReport(args.options, *result));
  return result->faults.empty() ? 0 : ExitStatus({ErrorCode::kBadData, ""});
}

}  // namespace sateen::cli
