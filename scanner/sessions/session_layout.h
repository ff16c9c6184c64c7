#pragma once

#include <filesystem>

#include "core/error.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// A folder with session.json. The rig is options.rig_file, else the one that the session names;
// frames are matched to its lights by name.
[[nodiscard]] Result<ReadPlan> PlanSession(const std::filesystem::path& dir,
                                           const ReadDatasetOptions& options);

// The record and the rig of it alone, no frames: for sessions that may have several of a light.
[[nodiscard]] Result<ReadPlan> PlanSessionRig(const std::filesystem::path& dir,
                                              const ReadDatasetOptions& options);

}  // namespace sateen
