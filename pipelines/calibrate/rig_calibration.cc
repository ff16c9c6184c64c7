#include "pipelines/calibrate/rig_calibration.h"

#include <ctime>

#include "core/version.h"
#include "pipelines/calibrate/rig_record.h"

namespace sateen {
namespace {

// Names the calibrations that `former` had and `rig` lacks; "" where there are none.
std::string LostFrom(const Rig& former, const Rig& rig) {
  std::string lost;
  const auto compare = [&](const char* kind, const auto& before, const auto& after) {
    if (before && before->date && !(after && after->date)) {
      lost += (lost.empty() ? "" : ", ") + std::string(kind);
    }
  };
  compare("lens", former.calibration.lens, rig.calibration.lens);
  compare("pose", former.calibration.pose, rig.calibration.pose);
  compare("response", former.calibration.response, rig.calibration.response);
  compare("lights", former.calibration.lights, rig.calibration.lights);
  return lost;
}

}  // namespace

void BeginCalibration(const std::filesystem::path& output, std::string_view kind,
                      RigCalibration& calibration) {
  calibration.output = output;
  calibration.pictures = output;
  calibration.pictures.replace_filename(fmt::format("{}-{}", output.stem().string(), kind));
}

void FillCommon(std::string_view kind, const RigCalibration& calibration,
                CalibrationRecord& record) {
  record.schema = fmt::format("sateen.calibrate.{}/1", kind);
  record.version = Version();
  record.seconds = calibration.seconds;
  record.warnings = calibration.warnings;
  record.inputs = calibration.sha256_of_input;
}

Status WriteCalibratedRig(RigCalibration& calibration) {
  const std::filesystem::path& output = calibration.output;
  std::error_code ignored;
  const Result<Rig> before =
      std::filesystem::exists(output, ignored) ? ReadRig(output) : Result<Rig>(Rig());
  const std::string lost = before ? LostFrom(*before, calibration.rig) : "";
  Result<std::filesystem::path> former = ReplaceRig(output, calibration.rig);
  if (!former) {
    return tl::unexpected(former.error());
  }
  calibration.former_output = *std::move(former);
  if (!lost.empty()) {
    calibration.warnings.push_back(fmt::format(
        "the calibration of {0} in {1} is not in the rig that was given with --rig and is lost "
        "there; {2} keeps it. To add to {1}, leave --rig out, or start from a copy of {1}",
        lost, output.string(), calibration.former_output.string()));
  }
  return {};
}

std::string DateOfNow() { return TimeText("%Y-%m-%dT%H:%M:%SZ"); }

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
