#include "pipelines/calibrate/rig_calibration.h"

#include "pipelines/calibrate/rig_record.h"

namespace sateen {
namespace {

// What the rig at `output` was calibrated for and the one that takes its place is not.
std::string LostFrom(const std::filesystem::path& output, const Rig& rig) {
  std::error_code ignored;
  const Result<Rig> former =
      std::filesystem::exists(output, ignored) ? ReadRig(output) : Result<Rig>(Rig());
  std::string lost;
  for (const char* kind : {"lens", "pose", "response", "lights"}) {
    if (former && !RecordedFigure(*former, kind, "date").is_null() &&
        RecordedFigure(rig, kind, "date").is_null()) {
      lost += (lost.empty() ? "" : ", ") + std::string(kind);
    }
  }
  return lost;
}

}  // namespace

Status WriteCalibratedRig(const std::filesystem::path& output, std::string_view kind,
                          const nlohmann::json& figures, RigCalibration& calibration) {
  RecordCalibration(calibration.rig, kind, figures, calibration.sha256_of_input);
  const std::string lost = LostFrom(output, calibration.rig);
  Result<std::filesystem::path> former = ReplaceRig(output, calibration.rig);
  if (!former) {
    return tl::unexpected(former.error());
  }
  calibration.former_rig = *std::move(former);
  if (!lost.empty()) {
    calibration.warnings.push_back(fmt::format(
        "the calibration of {} that {} had is not in the rig that was given with --rig and is left "
        "out; it is kept in {}. To add to {} leave --rig out, or begin from a copy of it",
        lost, output.string(), calibration.former_rig.string(), output.string()));
  }
  return {};
}

Result<std::optional<Rig>> ReadTrueRig(const std::filesystem::path& session) {
  const std::filesystem::path path = session / "truth" / "rig.json";
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) {
    return std::nullopt;
  }
  Result<Rig> rig = ReadRig(path);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  return *std::move(rig);
}

}  // namespace sateen
