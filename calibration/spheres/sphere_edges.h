#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "imaging/image.h"

namespace sateen {

// A circle in the plane of sphere_outline.h, equation (1).
inline constexpr int kRimPoints = 720;

struct PlaneCircle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius = 0.0;

  // `scale` radii from the centre, in direction `rim` of kRimPoints.
  [[nodiscard]] Eigen::Vector2d At(int rim, double scale = 1.0) const;
  [[nodiscard]] double Off(const Eigen::Vector2d& q) const { return (q - center).norm() - radius; }
};

// An edge across one of the radii of a circle.
struct RimEdge {
  Eigen::Vector2d at;  // in the plane
  int rim;             // which of the kRimPoints radii
  double slope = 1.0;  // of the brightness [1/px], its weight in the fit
};

using PixelOfPlane = std::function<Eigen::Vector2d(const Eigen::Vector2d&)>;

// The edges across the radii of `circle`, within `band` of the radius each way: where the
// brightness, smoothed by a two-hundredth of the radius, changes fastest, between pixels too.
[[nodiscard]] std::vector<RimEdge> EdgesAround(const Image<float>& gray,
                                               const PixelOfPlane& pixel_of,
                                               const PlaneCircle& circle, double radius_px,
                                               double band);

// The circle near `rough` that meets edges on most radii, of 2000 through three random edges each.
// The same each time.
[[nodiscard]] PlaneCircle BestOfTriples(const std::vector<RimEdge>& edges, const PlaneCircle& rough,
                                        double tolerance);

// Equation (2) by Gauss and Newton's method, over edges within `tolerance` of the circle, which closes
// in on 3 robust standard deviations. Leaves `edges` with those used.
[[nodiscard]] PlaneCircle FitPlaneCircle(std::vector<RimEdge>& edges, PlaneCircle circle,
                                         double tolerance);

// The share of radii on which one of these edges lies.
[[nodiscard]] double ShareSeen(const std::vector<RimEdge>& edges);

}  // namespace sateen
