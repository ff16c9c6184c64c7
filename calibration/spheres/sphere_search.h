#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// About where a sphere is seen: to some 5 % of its radius.
struct Circle {
  Eigen::Vector2d center_px = Eigen::Vector2d::Zero();
  double radius_px = 0.0;
};

// The mean of the three planes: what the sphere functions look at.
[[nodiscard]] Image<float> MeanOfPlanes(const Image3& photo);

// A mask as a photograph, 1 inside and 0 outside, for FindSphere.
[[nodiscard]] Image<float> AsPhotograph(const Mask& mask);

/// The `count` spheres of a mask (0: all), largest first: connected regions, each as the circle of its area
/// about its centroid. Regions below a twentieth of the largest are dust.
///
/// mask     `name` names it in messages
/// Errors   kBadData: other than `count` regions, or none
/// Cost     O(pixels)
[[nodiscard]] Result<std::vector<Circle>> CirclesInMask(const Mask& mask, int count,
                                                        std::string_view name);

/// The `count` most complete circles of a photograph, left to right, for want of a mask; 0: those of
/// 80 % of the completeness and half the radius of the best. A Hough
/// transform of the gradients of the picture at 256 px, and for each centre that it favours the
/// radius round which most of 72 directions show an edge across. Dark and bright backgrounds may
/// alternate round the sphere.
///
/// gray     best a picture by room light, or else the mean of all lit ones
/// Errors   kInvalidArgument: count < 0
///          kDegenerate: fewer circles of which 40 % are seen
/// Cost     O(pixels), some 50 ms
[[nodiscard]] Result<std::vector<Circle>> FindCircles(const Image<float>& gray, int count,
                                                      std::string_view name);

}  // namespace sateen
