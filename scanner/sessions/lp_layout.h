#pragma once

#include <filesystem>

#include "core/error.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Plans an RTI .lp file: the number of lights, then one line "filename x y z" for each light; x
// right, y up, z to the viewer. Names may contain blanks. Files that are not where the author's
// machine had them are looked for beside the .lp file.
[[nodiscard]] Result<ReadPlan> PlanLp(const std::filesystem::path& lp_file);

}  // namespace sateen
