#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "calibration/spheres/sphere_highlight.h"
#include "calibration/spheres/sphere_outline.h"
#include "core/error.h"
#include "rig/camera.h"
#include "rig/light.h"

namespace sateen {

// Ray from the highlight of a sphere to the lamp.
struct SphereRay {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();        // on the sphere, in its frame and unit
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit, towards the lamp
};

/// Reflects the viewing ray o + s d of a highlight at the sphere of centre c and radius R:
///
///     s = (c - o) . d - sqrt(R^2 - |c - o|^2 + ((c - o) . d)^2),   p = o + s d               (1)
///     n = (p - c) / R,   v = -d,   l = 2 (n . v) n - v                                      (2)
///
/// With a camera, o is its position and d its ray through the pixel; without one d = -z. l points
/// to the lamp. n, which is often taken for it, points halfway.
///
/// camera   as in SphereOptions::camera
/// Errors   kBadData: the highlight is not on the sphere
[[nodiscard]] Result<SphereRay> ReflectedRay(const Sphere& sphere,
                                             const std::optional<Camera>& camera,
                                             const Eigen::Vector2d& highlight_px);

// Lamp of one frame.
struct SphereLight {
  Light light;
  // Root mean square angle between each ray and the direction from its sphere to the light; 0 for
  // one ray.
  double residual_rad = 0.0;
  // Standard deviation of the position along the table's axes; nothing for a direction.
  std::optional<Eigen::Vector3d> position_sd_mm;
};

struct SphereLightOptions {
  // Largest standard deviation of a position, in its worst direction and as a share of the
  // distance; above it the light is distant. (0, 1].
  double most_position_sd = 0.2;
  // Least standard deviation of a ray, because few rays do not tell it: 0.3 px on a sphere of 200
  // px radius. (0, 1).
  double ray_sd_rad = 0.002;
  // Largest residual of rays of one lamp. (0, 1).
  double most_residual_rad = 0.035;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Fits the lamp to the rays of one frame, one per sphere. One ray gives a direction. Several give
/// a position that minimizes the angles by which rays miss it,
///
///     argmin_s sum_j |(I - l_j l_j^T) (s - p_j)|^2 / d_j^2,   d_j = l_j . (s - p_j)          (1)
///
/// Its covariance is the inverse normal matrix times the square of the larger of ray_sd_rad and the
/// standard deviation of the residuals. If the lamp is too far to tell from infinity, the light is
/// distant, along the mean of the rays.
///
/// A mirror's highlight is mostly saturated, so spheres do not tell the flux: flux_rgb is 1.
///
/// rays     one per sphere; in millimetres with a camera
/// has_camera  false: depths are not known, and any number of rays gives their mean direction
/// Errors   kInvalidArgument: an option out of range; no ray
///          kDegenerate: the rays do not meet
[[nodiscard]] Result<SphereLight> LightFromRays(const std::vector<SphereRay>& rays, bool has_camera,
                                                std::string_view frame,
                                                const SphereLightOptions& options = {});

}  // namespace sateen
