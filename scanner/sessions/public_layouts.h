#pragma once

#include <filesystem>

#include "core/error.h"
#include "scanner/sessions/read_plan.h"

namespace sateen {

// Public data layouts of folders. Directions point from the surface to the light: x right, y up in
// the image, z to the viewer.

// Plans a DiLiGenT folder: light_directions.txt, light_intensities.txt (RGB, divisors),
// filenames.txt.
[[nodiscard]] Result<ReadPlan> PlanDiligent(const std::filesystem::path& dir);

// Plans a folder of images in natural order, one for each light of `lights_file` (ReadLightTable).
[[nodiscard]] Result<ReadPlan> PlanLightsFolder(const std::filesystem::path& dir,
                                                const std::filesystem::path& lights_file);

// Plans a folder of photographs in natural order, one for each light. The lights are found
// elsewhere: until then they are named after the files and shine from straight above. The folder's
// own mask is used; a reference picture (IsReferenceName) is not a frame.
[[nodiscard]] Result<ReadPlan> PlanPhotographs(const std::filesystem::path& dir);

// Adds to `plan` the mask (unless `find_mask` is false) and the truth that lie in `dir`; else the
// mask.* one folder up, and the truth in `shared_dir`: data sets of several folders keep one.
[[nodiscard]] Status FindCompanions(const std::filesystem::path& dir,
                                    const std::filesystem::path& shared_dir, bool find_mask,
                                    ReadPlan& plan);

// Returns the folder that "dir/.." names, also for "." and "dir/".
[[nodiscard]] std::filesystem::path ParentOf(const std::filesystem::path& dir);

}  // namespace sateen
