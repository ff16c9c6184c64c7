#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// How a flat board appears in a picture, without distortion: millimetres on it to pixels.
using PlaneMap = Eigen::Matrix3d;

[[nodiscard]] Eigen::Vector2d MapPoint(const PlaneMap& map, const Eigen::Vector2d& x_mm);

// Least squares over at least 4 points; with `slack_px`, over those that a common map takes to
// within it (RANSAC). Nothing where the points lie in one line.
[[nodiscard]] std::optional<PlaneMap> FitPlaneMap(const std::vector<Eigen::Vector3d>& points_mm,
                                                  const std::vector<Eigen::Vector2d>& corners_px,
                                                  std::optional<double> slack_px = std::nullopt);

// Grey levels by which the squares to the top right and bottom left of a corner are brighter than
// the two others. Nothing where one of them is out of the picture.
[[nodiscard]] std::optional<double> CrossingContrast(const Image<uint8_t>& grey,
                                                     const PlaneMap& map,
                                                     const Eigen::Vector2d& at_mm,
                                                     double square_mm);

// Half the side of the square of pixels, 2 to 12, that lies within `reach_mm` of a corner.
[[nodiscard]] int CornerWindowPx(const PlaneMap& map, const Eigen::Vector2d& at_mm,
                                 double reach_mm);

}  // namespace sateen
