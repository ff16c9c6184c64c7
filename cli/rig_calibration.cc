#include "cli/rig_calibration.h"

#include "cli/rig_record.h"

namespace sateen::cli {

Status WriteCalibratedRig(const std::filesystem::path& output, std::string_view kind,
                          const nlohmann::json& figures, RigCalibration& calibration) {
  RecordCalibration(calibration.rig, kind, figures, calibration.sha256_of_input);
  Result<std::filesystem::path> former = ReplaceRig(output, calibration.rig);
  if (!former) {
    return tl::unexpected(former.error());
  }
  calibration.former_rig = *std::move(former);
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

}  // namespace sateen::cli
