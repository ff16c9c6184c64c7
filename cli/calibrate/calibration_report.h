#pragma once

#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command.h"
#include "core/error.h"
#include "pipelines/calibrate/rig_calibration.h"

namespace sateen {
struct LensCalibration;
struct PoseCalibration;
struct ResponseCalibration;
struct LightsCalibration;
struct SpheresCalibration;
}  // namespace sateen

namespace sateen::cli {

// Adds --threads and --json, the last options of each calibrator.
void AddThreadsAndJson(CLI::App& cmd, int& threads, bool& json);

// Return the report as one JSON object (docs/formats.md): the record and the files written.
[[nodiscard]] std::string JsonReport(const LensCalibration& result);
[[nodiscard]] std::string JsonReport(const PoseCalibration& result);
[[nodiscard]] std::string JsonReport(const ResponseCalibration& result);
[[nodiscard]] std::string JsonReport(const LightsCalibration& result);
[[nodiscard]] std::string JsonReport(const SpheresCalibration& result);

// Returns the last lines of a text report: the copy of the previous file, the file that was written
// and the pictures to look at.
[[nodiscard]] std::string FilesText(const RigCalibration& result, std::string_view pictures);

// Prints lines "sateen calibrate <kind>: <what>: <line>".
void PrintLines(std::string_view kind, std::string_view what, const std::vector<std::string>& lines,
                std::ostream& log);

// Ends `sateen calibrate <kind>`: prints warnings or the error to `log`, the report to `out`.
// Returns the exit status.
template <typename Calibration>
int FinishCalibration(std::string_view kind, bool as_json, const Result<Calibration>& result,
                      std::string (*text_report)(const Calibration&), std::ostream& out,
                      std::ostream& log) {
  if (!result) {
    PrintLines(kind, "error", {result.error().message}, log);
    return ExitStatus(result.error());
  }
  PrintLines(kind, "warning", result->warnings, log);
  out << (as_json ? JsonReport(*result) + "\n" : text_report(*result));
  return 0;
}

}  // namespace sateen::cli
