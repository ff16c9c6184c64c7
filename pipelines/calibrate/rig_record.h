#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "rig/rig.h"

namespace sateen {

// The figures of one kind of calibration ("lens", "lights") as they go into a rig's `calibration`
// object beside those of other kinds, with date, program version and hashes of what was read.
void RecordCalibration(Rig& rig, std::string_view kind, nlohmann::json figures,
                       const std::map<std::string, std::string>& sha256_of_input);

// The rig that a calibration adds to: `rig_file` or, where that is empty, what is at `output`
// already; without either a rig of nothing.
[[nodiscard]] Result<Rig> RigToBeginWith(const std::filesystem::path& rig_file,
                                         const std::filesystem::path& output);

// Its file, for what reads sessions: nothing where neither is there, and the session's own rig counts.
[[nodiscard]] std::optional<std::filesystem::path> RigFileToBeginWith(
    const std::filesystem::path& rig_file, const std::filesystem::path& output);

// One value of what RecordCalibration() recorded; null where there is none.
[[nodiscard]] nlohmann::json RecordedFigure(const Rig& rig, const std::string& kind,
                                            const std::string& figure);

// Writes the file whole. One that is there already is first kept as a copy with the date and time in
// its name, which is returned; empty where there was none.
[[nodiscard]] Result<std::filesystem::path> ReplaceFile(const std::filesystem::path& path,
                                                        const std::string& text);

// The same with the rig's file.
[[nodiscard]] Result<std::filesystem::path> ReplaceRig(const std::filesystem::path& path,
                                                       const Rig& rig);

}  // namespace sateen
