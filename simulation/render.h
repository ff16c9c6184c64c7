#pragma once

#include <cstdint>
#include <optional>

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "simulation/scene.h"

namespace sateen {

// Maps that all frames of a scene share: where each pixel looks.
struct SurfaceMaps {
  Image3 point_mm;  // in the table frame
  Image3 normal;    // unit, table frame
  Image3 albedo;    // albedo of the Lambertian body
  Image<uint8_t> part;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  // shift of a bumped camera
};

struct RenderedFrame {
  Image3 radiance;
  // Share of the light that reaches the pixel, 255 = all of it, 0 = in attached or cast shadow.
  // Empty for a dark frame.
  Mask lit;
};

/// Renders the frames of a scene, one after the other:
///
///     i(x) = pi f_r(n, l, v) e max(0, n . l) V + rho (a + b),                            (1)
///     b(x) = 1/pi integral over directions w of i_direct(y(x, w)) max(0, n . w) dw       (2)
///
/// f_r is rho/pi plus the material's specular part; l and e come from rig/light.h at the surface
/// point itself; V is the visibility of the light, a the ambient irradiance, and y(x, w) the point
/// of the surface that x sees in direction w. Then i is multiplied by the vignetting and convolved
/// with the point spread. The bounce (2) takes the Lambertian bodies alone, by
/// `bounce_rays` cosine-distributed directions; its error falls as their number ^ -3/4 where light
/// varies smoothly.
///
/// Cost     O(pixels) per frame; about 40 bytes per pixel beside the frame. The same bits for any
///          number of threads.
class SceneRenderer {
 public:
  // Finds what each pixel sees. `scene` must outlive the renderer.
  //
  // Errors   kInvalidArgument: Scene::Validate(); kBadData: a pixel that does not see the surface;
  //          kCancelled
  [[nodiscard]] static Result<SceneRenderer> Create(const Scene& scene, const Task& task = {});

  // Returns the maps as every frame sees them before a bump.
  [[nodiscard]] const SurfaceMaps& Maps() const { return maps_; }

  // Renders the frame of light `light`, an index into the rig's, or with all lights off.
  [[nodiscard]] Result<RenderedFrame> Render(std::optional<size_t> light, const Task& task = {});

 private:
  explicit SceneRenderer(const Scene& scene) : scene_(&scene) {}

  const Scene* scene_;
  SurfaceMaps maps_;
  std::optional<SurfaceMaps> bumped_;
};

}  // namespace sateen
