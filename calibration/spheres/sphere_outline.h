#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "calibration/spheres/sphere_search.h"
#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

// Pixels of one row.
struct PixelSpan {
  int y = 0;
  int x_begin = 0;
  int x_end = 0;  // exclusive
};

// Sphere in its place: with a camera in the table frame [mm]; without one in pixels, x right, y up,
// z to the viewer, origin at pixel (0, 0). Its depth z is then not known and set to 0.
struct Sphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
  Circle outline;                    // mean circle about the centroid of the outline
  std::vector<Eigen::Vector2d> rim;  // points of the outline [px]
  std::vector<PixelSpan> interior;   // pixels within 97 % of the outline
  // Root mean square distance of edges from the outline, and share of it on which an edge was seen;
  // both 0 for a circle that was given.
  double residual_px = 0.0;
  double seen = 0.0;
};

struct SphereOptions {
  // Camera that took the photographs. Nothing: they are treated as orthographic, as RTI does. For a
  // camera at distance d, directions are then off by up to (distance from the image's centre) / d.
  std::optional<Camera> camera;
  double radius_mm = 0.0;  // radius of the sphere; needed with a camera, > 0
  // Least share of the outline on which an edge is found, (0, 1].
  double least_seen = 0.4;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Finds a sphere by its outline in a photograph or a mask.
///
/// The rays that touch a sphere form a circular cone about its centre. In the image they form an
/// ellipse, whose centre is not the image of the sphere's centre; with lens distortion it is not
/// even an ellipse. So rays are mapped to a plane where such a cone is exactly a circle: for the
/// unit ray d and a ray a near the sphere's centre, by stereographic projection,
///
///     q = 2 (d . e1, d . e2) / (1 + d . a),     e1, e2, a orthonormal                       (1)
///     argmin_{q0, r} sum_j (|q_j - q0| - r)^2                                               (2)
///
/// and undone: with t = |q0|, the cone's near and far sides are b+- = 2 atan((t +- r) / 2), so
///
///     axis at (b+ + b-) / 2 from a, towards q0;  half angle  w = (b+ - b-) / 2              (3)
///     centre = camera + radius_mm / sin w * axis                                            (4)
///
/// Without a camera q is the pixel, and (2) is all. Edges are searched along the radii of `rough`;
/// the best circle comes from random triples of edges with a fixed seed, and is refined twice.
///
/// gray     a photograph (FindCircles says which) or a mask (AsPhotograph)
/// rough    to some 5 % of the radius, by CirclesInMask, FindCircles or a person
/// name     name of the photograph, for messages
/// Errors   kInvalidArgument: an option out of range
///          kBadData: the sphere is cut by the frame; the photograph has not the camera's size
///          kDegenerate: too little of the outline is seen
/// Cost     O(radius), some 50 ms at 500 px; deterministic
[[nodiscard]] Result<Sphere> FindSphere(const Image<float>& gray, const Circle& rough,
                                        std::string_view name, const SphereOptions& options = {});

/// Returns the sphere whose outline a person marked, by (1) to (4) from `circle` as it is.
///
/// size     size of the photographs
/// Errors   as FindSphere(), except kDegenerate
[[nodiscard]] Result<Sphere> SphereFromCircle(const Circle& circle, ImageSize size,
                                              std::string_view name,
                                              const SphereOptions& options = {});

}  // namespace sateen
