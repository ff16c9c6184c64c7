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

// The way from a sphere's highlight to the lamp.
struct SphereRay {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();        // on the sphere, in its frame and unit
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit, towards the lamp
};

/// The viewing ray of a highlight, reflected by the sphere c, R. With the sight o + s d,
///
///     s = (c - o) . d - sqrt(R^2 - |c - o|^2 + ((c - o) . d)^2),   p = o + s d               (1)
///     n = (p - c) / R,   v = -d,   l = 2 (n . v) n - v                                      (2)
///
/// with a camera o is its place and d its ray through the pixel, without one d = -z. It is l that
/// points to the lamp; n, which is often taken for it, points halfway.
///
/// camera   as in SphereOptions::camera
/// Errors   kBadData: the highlight is not on the sphere
[[nodiscard]] Result<SphereRay> ReflectedRay(const Sphere& sphere,
                                             const std::optional<Camera>& camera,
                                             const Eigen::Vector2d& highlight_px);

// One frame's lamp.
struct SphereLight {
  Light light;
  // Root mean square angle between each ray and the way from its sphere to the light. 0 for one.
  double residual_rad = 0.0;
  // Standard deviation of the position along the table's axes; nothing for a direction.
  std::optional<Eigen::Vector3d> position_sd_mm;
};

struct SphereLightOptions {
  // A position is given where its standard deviation, in its worst direction, is at most this share
  // of the distance; otherwise the light is distant. (0, 1].
  double most_position_sd = 0.2;
  // Standard deviation of a ray, which few rays cannot tell: 0.3 px of a sphere of 200 px radius.
  double ray_sd_rad = 0.002;
  // Rays that miss each other by more are not of one lamp.
  double most_residual_rad = 0.035;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// The lamp from the rays of one frame, one a sphere. One ray gives a direction; several a position,
///
///     argmin_s sum_j |(I - l_j l_j^T) (s - p_j)|^2 / d_j^2,   d_j = l_j . (s - p_j)          (1)
///
/// each miss as an angle. Its covariance is the inverse normal matrix times the square of the
/// larger of ray_sd_rad and the residuals' own. Where that says that the lamp is too far to tell from
/// infinity, the light is distant, along the mean of the rays.
///
/// A mirror's highlight is mostly saturated, so spheres say nothing of flux: flux_rgb is 1.
///
/// rays     of spheres with a camera, in millimetres; without one as many as you like give the mean
///          direction, for depths are not known: `has_camera`
/// Errors   kInvalidArgument: an option out of range; no ray
///          kDegenerate: the rays do not meet
[[nodiscard]] Result<SphereLight> LightFromRays(const std::vector<SphereRay>& rays, bool has_camera,
                                                std::string_view frame,
                                                const SphereLightOptions& options = {});

}  // namespace sateen
