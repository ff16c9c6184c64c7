#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "calibration/spheres/sphere_search.h"
#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

struct PixelSpan {
  int y = 0;
  int x_begin = 0;
  int x_end = 0;  // exclusive
};

// A sphere where it stands. With a camera in millimetres of the table frame; without one in pixels,
// x right, y up, z to the viewer, origin at pixel (0, 0), at a depth z that nobody knows: 0.
struct Sphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
  Circle outline;                    // as it is seen: the mean circle about the outline's centroid
  std::vector<Eigen::Vector2d> rim;  // points of the outline [px]
  std::vector<PixelSpan> interior;   // the pixels within 97 % of the outline
  // Of an outline that was found: root mean square of edges from it, and the share of it on which an
  // edge was seen. 0 for a circle that was given.
  double residual_px = 0.0;
  double seen = 0.0;
};

struct SphereOptions {
  // The camera that took the photographs. Nothing: they are taken as orthographic, as RTI does; with
  // the camera d away that is off by up to (distance from the image's centre) / d.
  std::optional<Camera> camera;
  double radius_mm = 0.0;  // of the sphere; needed with a camera, > 0
  // Share of the outline on which an edge must be found, (0, 1].
  double least_seen = 0.4;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// A sphere from its outline in a photograph or a mask.
///
/// The rays that touch a sphere form a circular cone about its centre. Its trace in the image is an
/// ellipse, whose centre is not the image of the sphere's; with lens distortion it is not even that.
/// So the rays are drawn in a plane where such a cone is exactly a circle again: for the unit ray d
/// and a ray a near the sphere's centre, by stereographic projection,
///
///     q = 2 (d . e1, d . e2) / (1 + d . a),     e1, e2, a orthonormal                       (1)
///     argmin_{q0, r} sum_j (|q_j - q0| - r)^2                                               (2)
///
/// and undone: with t = |q0|, the cone's near and far sides are b+- = 2 atan((t +- r) / 2), so
///
///     axis at (b+ + b-) / 2 from a, towards q0;  half angle  w = (b+ - b-) / 2              (3)
///     centre = camera + radius_mm / sin w * axis                                            (4)
///
/// Without a camera q is the pixel and (2) all there is. Edges are looked for along the radii of
/// `rough`, the best circle through them by random triples (a fixed seed), then closer by twice.
///
/// gray     a photograph (FindCircles says which) or a mask (AsPhotograph)
/// rough    to some 5 % of the radius, by CirclesInMask, FindCircles or a person
/// name     of the photograph, in messages
/// Errors   kInvalidArgument: an option out of range
///          kBadData: the sphere is cut by the frame; a photograph of another size than the camera's
///          kDegenerate: too little of the outline is seen
/// Cost     O(radius), some 50 ms at 500 px; deterministic
[[nodiscard]] Result<Sphere> FindSphere(const Image<float>& gray, const Circle& rough,
                                        std::string_view name, const SphereOptions& options = {});

/// A sphere whose outline a person marked: `circle` counts as it is, by (1) to (4).
///
/// size     of the photographs
/// Errors   as FindSphere, but for what is seen
[[nodiscard]] Result<Sphere> SphereFromCircle(const Circle& circle, ImageSize size,
                                              std::string_view name,
                                              const SphereOptions& options = {});

}  // namespace sateen
