#pragma once

#include <filesystem>

#include "core/error.h"
#include "core/json.h"
#include "simulation/scene.h"

namespace sateen::cli {

// The parts of a scene file that describe what lies on the table.

// "surface"; files that it names are looked for in `folder`. Finishes `reader` where it succeeds.
[[nodiscard]] Result<SurfacePtr> ReadSurface(JsonReader& reader,
                                             const std::filesystem::path& folder);

// "materials": one for each part of scene.surface.
[[nodiscard]] Status ReadMaterials(JsonReader reader, Scene& scene);

}  // namespace sateen::cli
