#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Rough outline of a sphere, to some 5 % of its radius.
struct Circle {
  Eigen::Vector2d center_px = Eigen::Vector2d::Zero();
  double radius_px = 0.0;
};

// Returns the mean of the three planes, which the sphere functions use.
[[nodiscard]] Image<float> MeanOfPlanes(const Image3& photo);

// Returns a mask as a photograph, 1 inside and 0 outside, for FindSphere().
[[nodiscard]] Image<float> AsPhotograph(const Mask& mask);

/// Finds the spheres of a mask, largest first: each connected region as the circle of its area
/// about its centroid. Regions below a twentieth of the largest are dust.
///
/// count    number of spheres; 0: any
/// name     name of the mask, for messages
/// Errors   kBadData: another number of regions, or none
/// Cost     O(pixels)
[[nodiscard]] Result<std::vector<Circle>> CirclesInMask(const Mask& mask, int count,
                                                        std::string_view name);

/// Finds the most complete circles of a photograph, left to right, where there is no mask. A Hough
/// transform of the gradients at 256 px gives centres; the radius of each is the one at which most
/// of 72 directions have an edge across. The background may be darker or brighter than the sphere
/// in each direction.
///
/// gray     best a picture by room light, else the mean of all lit ones
/// count    number of circles; 0: those of 80 % of the completeness and half the radius of the best
/// Errors   kInvalidArgument: count < 0
///          kDegenerate: fewer circles of which 40 % are seen
/// Cost     O(pixels), some 50 ms
[[nodiscard]] Result<std::vector<Circle>> FindCircles(const Image<float>& gray, int count,
                                                      std::string_view name);

}  // namespace sateen
