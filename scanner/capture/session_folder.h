#pragma once

#include <filesystem>

#include "core/error.h"
#include "rig/rig.h"
#include "scanner/capture/capture_options.h"
#include "scanner/capture/journal.h"

namespace sateen {

inline constexpr const char* kSessionFile = "session.json";
inline constexpr const char* kSavedRigFile = "rig.json";  // the rig, as it was at the beginning

/// Returns the rig if a capture can begin in `dir`. Changes nothing.
///
/// Errors   kInvalidArgument: options; the folder holds a session that is complete or has a frame,
///          or frames without a journal, or another rig.json, or links where its own files must go
///          kBadData: the rig has no lights, or two with one channel
///          kIo: the rig cannot be read; the folder cannot be written to
[[nodiscard]] Result<Rig> CheckBegin(const std::filesystem::path& dir,
                                     const std::filesystem::path& rig_file,
                                     const CaptureOptions& options);

/// Returns the journal if the capture in `dir` can be continued. Locks and changes nothing.
///
/// Errors   kInvalidArgument: a link where the session's own files must be
///          kIo: no journal, or it cannot be read
///          kBadData: the journal is not one, or has no whole line; the rig is not the one that the
///          capture began with; the plan is not one of this program
[[nodiscard]] Result<Journal> CheckResume(const std::filesystem::path& dir);

// Returns the error of changing the exposure of a complete session.
[[nodiscard]] Error CompleteSessionError(const std::filesystem::path& dir);

}  // namespace sateen
