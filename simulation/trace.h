#pragma once

#include <Eigen/Core>
#include <optional>

#include "simulation/surface.h"

namespace sateen {

struct Ray {
  Eigen::Vector3d origin_mm;
  Eigen::Vector3d direction;  // unit

  [[nodiscard]] Eigen::Vector3d At(double t_mm) const { return origin_mm + t_mm * direction; }
};

/// Returns where a ray from above first meets the surface, by sphere tracing of a height field,
///
///     t += (z(t) - h(x(t), y(t))) / (-d_z + S |d_xy|),        S = MaxSlope()                (1)
///
/// which never passes the surface because the gap cannot close faster; close to it Newton's method.
/// A ray that rises faster than S |d_xy| meets nothing.
/// The answer is exact to 1e-9 mm for smooth surfaces, and nothing if the ray stays above.
///
/// Source   Hart, "Sphere tracing", The Visual Computer 12, 1996.
[[nodiscard]] std::optional<double> FirstHit(const Surface& surface, const Ray& ray);

// Returns where a ray that leaves a point of the surface meets it again, up to `distance_mm` away;
// nothing if it gets away. Follows (1) with steps of at least `finest_step` times the surface's
// detail. That step sets how exact the answer is, and how long rays take that graze the surface.
[[nodiscard]] std::optional<double> NextHit(const Surface& surface, const Ray& ray,
                                            double distance_mm, double finest_step);

// Returns true if the way from a point on the surface to `to_light` (unit), up to `distance_mm`
// away, is free. The shadow's edge is exact to 1e-5 of the surface's detail.
[[nodiscard]] bool IsVisible(const Surface& surface, const Eigen::Vector3d& point_mm,
                             const Eigen::Vector3d& to_light, double distance_mm);

}  // namespace sateen
