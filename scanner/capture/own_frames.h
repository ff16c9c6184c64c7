#pragma once

#include <cstddef>
#include <filesystem>

#include "core/error.h"
#include "scanner/capture/journal.h"

// A capture removes and replaces files in frames/ only if its journal has them as frames that are
// done, or began a frame of that name that was never done: its file may have any ending of camera
// RAW. Whatever else is there belongs to someone else, and is named and left.
namespace sateen {

inline constexpr const char* kFramesFolder = "frames";

// Fails with kInvalidArgument where frames/ or a file that a capture writes is a link: the files
// beyond it are not the session's.
[[nodiscard]] Status CheckNoLinks(const std::filesystem::path& dir);

// Fails with kInvalidArgument where the frame's file would replace one that is not this capture's.
[[nodiscard]] Status CheckFrameName(const std::filesystem::path& dir, const Journal& journal,
                                    std::size_t frame);

// Fails with kInvalidArgument where `file`, "frames/03-led-2.nef", is there and not this capture's.
[[nodiscard]] Status CheckFrameFile(const std::filesystem::path& dir, const Journal& journal,
                                    const std::filesystem::path& file);

// Removes the capture's files that are no frame of its plan: those of earlier plans and of tries
// that were killed.
void RemoveFormerFrames(const std::filesystem::path& dir, const Journal& journal);

// Tells, in one notice, what lies in frames/ that is not the capture's.
void NameOtherFiles(const std::filesystem::path& dir, const Journal& journal);

}  // namespace sateen
