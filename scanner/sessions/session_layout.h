#pragma once

#include <filesystem>

#include "core/error.h"
#include "scanner/sessions/read_plan.h"
#include "scanner/sessions/stack_reader.h"

namespace sateen {

// A folder with session.json. The rig is options.rig_file, else the one that the session names;
// frames are matched to its lights by name.
[[nodiscard]] Result<CapturePlan> PlanSession(const std::filesystem::path& dir,
                                              const ReadCaptureOptions& options);

// The record and the rig of it alone, no frames: for sessions that may have several of a light.
[[nodiscard]] Result<CapturePlan> PlanSessionRig(const std::filesystem::path& dir,
                                                 const ReadCaptureOptions& options);

}  // namespace sateen
