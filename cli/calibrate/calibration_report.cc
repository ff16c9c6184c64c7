#include "cli/calibrate/calibration_report.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/json.h"
#include "pipelines/calibrate/calibrate_lens.h"
#include "pipelines/calibrate/calibrate_lights.h"
#include "pipelines/calibrate/calibrate_pose.h"
#include "pipelines/calibrate/calibrate_response.h"
#include "pipelines/calibrate/calibrate_spheres.h"
#include "rig/calibration_json.h"

namespace sateen::cli {
namespace {

std::string WithFiles(nlohmann::json report, const RigCalibration& result,
                      const char* former_key = "former_rig") {
  report["warnings"] = result.warnings;  // also those of writing, which came after the record
  report["output"] = result.output.string();
  report[former_key] = result.former_output.string();
  report["pictures"] = result.pictures.string();
  return JsonText(report);
}

}  // namespace

void AddThreadsAndJson(CLI::App& cmd, int& threads, bool& json) {
  cmd.add_option("--threads", threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd.add_flag("--json", json, "Print one JSON object on stdout instead of text");
}

std::string JsonReport(const LensCalibration& result) {
  return WithFiles(ToJson(result.record), result);
}

std::string JsonReport(const PoseCalibration& result) {
  return WithFiles(ToJson(result.record), result);
}

std::string JsonReport(const ResponseCalibration& result) {
  return WithFiles(ToJson(result.record), result);
}

std::string JsonReport(const LightsCalibration& result) {
  return WithFiles(ToJson(result.record), result);
}

std::string JsonReport(const SpheresCalibration& result) {
  return WithFiles(ToJson(result.record), result, "former_output");
}

std::string FilesText(const RigCalibration& result, std::string_view pictures) {
  const std::string kept =
      result.former_output.empty()
          ? ""
          : fmt::format("the previous file is kept as {}\n", result.former_output.string());
  return kept + fmt::format("wrote {} after {:.1f} s; see {}\n", result.output.string(),
                            result.seconds, pictures);
}

void PrintLines(std::string_view kind, std::string_view what, const std::vector<std::string>& lines,
                std::ostream& log) {
  for (const std::string& line : lines) {
    log << "sateen calibrate " << kind << ": " << what << ": " << line << '\n';
  }
}

}  // namespace sateen::cli
