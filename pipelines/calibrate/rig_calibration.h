#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "rig/rig.h"

namespace sateen {

// What every calibration that goes into a rig has beside its own figures.
struct RigCalibration {
  Rig rig;  // as it is written
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;
  std::filesystem::path pictures;
  std::filesystem::path former_rig;  // empty: there was none
  double seconds = 0.0;
};

// Records the figures of one kind of calibration in the rig and writes it to `output`; one that is
// there is kept as `former_rig`.
[[nodiscard]] Status WriteCalibratedRig(const std::filesystem::path& output, std::string_view kind,
                                        const nlohmann::json& figures, RigCalibration& calibration);

// The rig that a simulated session was rendered with, to compare with; nothing of a photographed one.
[[nodiscard]] Result<std::optional<Rig>> ReadTrueRig(const std::filesystem::path& session);

// Ends `sateen calibrate <kind>`: writes the rig, then warnings or the error to `log` and the report to
// `out`. Calibration: a RigCalibration with JsonReport() and TextReport(). Returns the exit status.
template <typename Args, typename Calibration>
int FinishCalibration(std::string_view kind, const Args& args, Result<Calibration> result,
                      std::ostream& out, std::ostream& log) {
  const Status status =
      result ? WriteCalibratedRig(args.output, kind,
                                  nlohmann::json::parse(JsonReport(args, *result)), *result)
             : tl::unexpected(result.error());
  if (!status) {
    log << "sateen calibrate " << kind << ": error: " << status.error().message << '\n';
    return ExitStatus(status.error());
  }
  for (const std::string& warning : result->warnings) {
    log << "sateen calibrate " << kind << ": warning: " << warning << '\n';
  }
  out << (args.json ? JsonReport(args, *result) + "\n" : TextReport(args, *result));
  return 0;
}

}  // namespace sateen
