#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// Homography from a flat board to a picture without distortion: millimetres to pixels.
using PlaneMap = Eigen::Matrix3d;

// Returns where the map takes a point.
[[nodiscard]] Eigen::Vector2d MapPoint(const PlaneMap& map, const Eigen::Vector2d& x_mm);

// Fits a map by least squares to at least 4 points. With `slack_px`, fits it to those that a common
// map takes to within that (RANSAC). Returns nothing where the points lie in one line.
[[nodiscard]] std::optional<PlaneMap> FitPlaneMap(const std::vector<Eigen::Vector3d>& points_mm,
                                                  const std::vector<Eigen::Vector2d>& corners_px,
                                                  std::optional<double> slack_px = std::nullopt);

// Returns by how many grey levels the squares to the top right and bottom left of a corner are
// brighter than the two others. Returns nothing where one of them is out of the picture.
[[nodiscard]] std::optional<double> CrossingContrast(const Image<uint8_t>& grey,
                                                     const PlaneMap& map,
                                                     const Eigen::Vector2d& at_mm,
                                                     double square_mm);

// Returns half the side of the square of pixels within `reach_mm` of a corner: 2 to 12.
[[nodiscard]] int CornerWindowPx(const PlaneMap& map, const Eigen::Vector2d& at_mm,
                                 double reach_mm);

}  // namespace sateen
