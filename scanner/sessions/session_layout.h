#pragma once

#include <filesystem>

#include "core/error.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Plans a folder with session.json. The rig is options.rig_file, else the one that the session
// names. Frames are matched to its lights by name.
[[nodiscard]] Result<ReadPlan> PlanSession(const std::filesystem::path& dir,
                                           const ReadDatasetOptions& options);

// Reads record and rig alone, without frames: for sessions that may have several frames per light.
[[nodiscard]] Result<ReadPlan> PlanSessionRig(const std::filesystem::path& dir,
                                              const ReadDatasetOptions& options);

}  // namespace sateen
