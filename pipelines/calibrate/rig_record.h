#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/error.h"
#include "rig/rig.h"

namespace sateen {

// Returns the time now, in UTC, formatted by std::strftime().
[[nodiscard]] std::string TimeText(const char* format);

// Reads the rig that a calibration adds to: `rig_file` or, where that is empty, what is at
// `output`. Returns an empty rig where neither is there.
[[nodiscard]] Result<Rig> RigToBeginWith(const std::filesystem::path& rig_file,
                                         const std::filesystem::path& output);

// Returns the file of that rig, for readers of sessions; nothing where neither is there, so that
// the session's own rig counts.
[[nodiscard]] std::optional<std::filesystem::path> RigFileToBeginWith(
    const std::filesystem::path& rig_file, const std::filesystem::path& output);

// Writes the file whole. Keeps a file that is there as a copy with date and time in its name, and
// returns the copy's path; empty where there was none. Where `path` is a link, the file that it
// leads to is replaced, and the copy lies beside the link.
[[nodiscard]] Result<std::filesystem::path> ReplaceFile(const std::filesystem::path& path,
                                                        const std::string& text);

// Does the same with a rig, once it is valid.
[[nodiscard]] Result<std::filesystem::path> ReplaceRig(const std::filesystem::path& path,
                                                       const Rig& rig);

}  // namespace sateen
