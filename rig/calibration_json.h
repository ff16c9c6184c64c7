#pragma once

// Calibration records as JSON; for .cc files only.

#include <nlohmann/json_fwd.hpp>

#include "rig/calibration_record.h"

namespace sateen {

// Reads the object `calibration` of rig.json. Never fails: values that are unknown, or not of their
// member's type, go to `other`.
[[nodiscard]] CalibrationRecords ReadCalibrationRecords(const nlohmann::json& object);

// Return objects of the members that are set and of the other keys; `{}` for an empty record.
[[nodiscard]] nlohmann::json ToJson(const CalibrationRecords& records);
[[nodiscard]] nlohmann::json ToJson(const LensRecord& record);
[[nodiscard]] nlohmann::json ToJson(const PoseRecord& record);
[[nodiscard]] nlohmann::json ToJson(const ResponseRecord& record);
[[nodiscard]] nlohmann::json ToJson(const LightsRecord& record);
[[nodiscard]] nlohmann::json ToJson(const SpheresRecord& record);

}  // namespace sateen
