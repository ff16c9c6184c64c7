#pragma once

#include <optional>

#include "pipelines/solve/solve_options.h"
#include "rig/camera.h"
#include "rig/rig.h"

namespace sateen {

// Facts that hold for all maps of a solve, whichever way they are written.
struct MapsFacts {
  NormalY normal_y = NormalY::kUp;
  // True if uncertainty.exr, albedo_uncertainty.exr and model.png are among the maps.
  bool has_ladder = false;
  // Camera whose pixels the maps have; absent where the rig has none.
  std::optional<Camera> camera;
  // Side of a pixel on the surface, at the middle of the maps; absent without a camera.
  std::optional<double> pixel_mm;
};

// Returns the facts of a solve with `rig`, whose table plane is the surface: lifted by
// options.height_mm. With options.undistort the maps' camera is the rig's without distortion.
[[nodiscard]] MapsFacts MapsFactsOf(const SolveOptions& options, const Rig& rig);

}  // namespace sateen
