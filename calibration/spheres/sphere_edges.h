#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "imaging/image.h"

namespace sateen {

inline constexpr int kRimPoints = 720;  // directions around a circle

// Circle in the plane of equation (1) of sphere_outline.h.
struct PlaneCircle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius = 0.0;

  // Returns the point `scale` radii from the centre in direction `rim` of kRimPoints.
  [[nodiscard]] Eigen::Vector2d At(int rim, double scale = 1.0) const;
  // Returns the distance from the circle; negative inside.
  [[nodiscard]] double Off(const Eigen::Vector2d& q) const { return (q - center).norm() - radius; }
};

// Edge across one of the radii of a circle.
struct RimEdge {
  Eigen::Vector2d at;  // in the plane
  int rim;             // number of its radius, of kRimPoints
  double slope = 1.0;  // slope of the brightness [1/px], its weight in the fit
};

// Returns the pixel of a point of the plane.
using PixelOfPlane = std::function<Eigen::Vector2d(const Eigen::Vector2d&)>;

// Finds the edges across the radii of `circle`, within `band` of the radius each way, to a fraction
// of a pixel: where the brightness, smoothed by a two-hundredth of the radius, changes fastest.
[[nodiscard]] std::vector<RimEdge> EdgesAround(const Image<float>& gray,
                                               const PixelOfPlane& pixel_of,
                                               const PlaneCircle& circle, double radius_px,
                                               double band);

// Returns the circle near `rough` that meets edges on most radii, of 2000 through three random
// edges each. The seed is fixed.
[[nodiscard]] PlaneCircle BestOfTriples(const std::vector<RimEdge>& edges, const PlaneCircle& rough,
                                        double tolerance);

// Fits equation (2) by Gauss and Newton's method to the edges within a tolerance of the circle. The
// tolerance falls from `tolerance` to 3 robust standard deviations. Leaves the used ones in
// `edges`.
[[nodiscard]] PlaneCircle FitPlaneCircle(std::vector<RimEdge>& edges, PlaneCircle circle,
                                         double tolerance);

// Returns the share of radii that have one of these edges.
[[nodiscard]] double ShareSeen(const std::vector<RimEdge>& edges);

}  // namespace sateen
