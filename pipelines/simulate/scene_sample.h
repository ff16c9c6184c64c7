#pragma once

#include <Eigen/Geometry>
#include <filesystem>

#include "core/error.h"
#include "core/json.h"
#include "simulation/scene.h"

namespace sateen {

// The parts of a scene file that describe what lies on the table.

// "surface"; files that it names are looked for in `folder`. Finishes `reader` where it succeeds.
[[nodiscard]] Result<SurfacePtr> ReadSurface(JsonReader& reader,
                                             const std::filesystem::path& folder);

// The frame of a plane: z its normal, the table's turned by the shortest way; its origin is the
// place above the table's.
[[nodiscard]] Eigen::Isometry3d TableFromPlane(const Surface& plane);

// "materials": one for each part of scene.surface.
[[nodiscard]] Status ReadMaterials(JsonReader reader, Scene& scene);

}  // namespace sateen
