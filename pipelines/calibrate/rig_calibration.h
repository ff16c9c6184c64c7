#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rig/rig.h"

namespace sateen {

// Members that the outcomes of all calibrators share.
struct RigCalibration {
  Rig rig;  // as it is written
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;
  std::filesystem::path output;         // the file that was written
  std::filesystem::path former_output;  // copy of the file that was there; empty: there was none
  std::filesystem::path pictures;       // folder
  double seconds = 0.0;
};

// Sets `output`, and `pictures` to a folder beside it: "rig-lens" for rig.json and kind "lens".
void BeginCalibration(const std::filesystem::path& output, std::string_view kind,
                      RigCalibration& calibration);

// Sets the members of CalibrationRecord, except for the date.
void FillCommon(std::string_view kind, const RigCalibration& calibration,
                CalibrationRecord& record);

// Writes calibration.rig to calibration.output. Keeps a rig that is there as a copy, former_output;
// warns of calibrations that it had and the new one lacks.
[[nodiscard]] Status WriteCalibratedRig(RigCalibration& calibration);

// Returns the time now, in UTC: "2026-05-04T03:02:01Z".
[[nodiscard]] std::string DateOfNow();

// Ends a calibration: puts the record into the rig, dated, and writes the rig.
template <typename Record>
[[nodiscard]] Status RecordAndWrite(const Record& record,
                                    std::optional<Record> CalibrationRecords::*member,
                                    RigCalibration& calibration) {
  Record& recorded = (calibration.rig.calibration.*member).emplace(record);
  recorded.date = DateOfNow();
  return WriteCalibratedRig(calibration);
}

// Reads the rig that a simulated session was rendered with; nothing for a session of photographs.
[[nodiscard]] Result<std::optional<Rig>> ReadTrueRig(const std::filesystem::path& session);

}  // namespace sateen
