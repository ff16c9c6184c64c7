#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "core/error.h"
#include "rig/rig.h"

namespace sateen::cli {

// The figures of one kind of calibration ("lens", "lights") as they go into a rig's `calibration`
// object beside those of other kinds, with date, program version and hashes of what was read.
void RecordCalibration(Rig& rig, std::string_view kind, nlohmann::json figures,
                       const std::map<std::string, std::string>& sha256_of_input);

// Writes the rig's file whole. One that is there already is first kept as a copy with the date and
// time in its name, which is returned; empty where there was none.
[[nodiscard]] Result<std::filesystem::path> ReplaceRig(const std::filesystem::path& path,
                                                       const Rig& rig);

}  // namespace sateen::cli
