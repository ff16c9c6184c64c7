#pragma once

#include <Eigen/Geometry>
#include <filesystem>

#include "core/error.h"
#include "core/json.h"
#include "simulation/scene.h"

namespace sateen {

// Parts of a scene file that describe the object on the table.

// Reads "surface"; files that it names are relative to `folder`. Finishes `reader` on success.
[[nodiscard]] Result<SurfacePtr> ReadSurface(JsonReader& reader,
                                             const std::filesystem::path& folder);

// Returns the frame of a plane: its z is the normal, the table's axes turned by the shortest way;
// its origin is above the table's.
[[nodiscard]] Eigen::Isometry3d TableFromPlane(const Surface& plane);

// Reads "materials": one for each part of scene.surface.
[[nodiscard]] Status ReadMaterials(JsonReader reader, Scene& scene);

}  // namespace sateen
