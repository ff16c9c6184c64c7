#include "simulation/trace.h"

#include <algorithm>
#include <cmath>

namespace sateen {
namespace {

constexpr int kMaxTraceSteps = 10000;
constexpr int kNewtonSteps = 8;
constexpr double kTouching_mm = 1e-10;
constexpr double kFarthest_mm = 1e6;  // beyond it, a ray looks past a plane that is tilted
constexpr double kShadowEdge = 1e-5;  // share of the detail

struct Gap {
  double height_mm;  // height of the ray above the surface
  double rate;       // its derivative along the ray
};

Gap GapAt(const Surface& surface, const Ray& ray, double t) {
  const Eigen::Vector3d at = ray.At(t);
  const SurfacePoint point = surface.At(at.x(), at.y());
  return {at.z() - point.height_mm, ray.direction.z() - point.slope.dot(ray.direction.head<2>())};
}

// Returns the fastest rate at which the gap can close; negative if the ray rises faster than any
// slope.
double ClosingRate(const Surface& surface, const Ray& ray) {
  return surface.MaxSlope() * ray.direction.head<2>().norm() - ray.direction.z() + 1e-12;
}

}  // namespace

std::optional<double> FirstHit(const Surface& surface, const Ray& ray) {
  if (!(ray.direction.z() < 0.0)) {
    return std::nullopt;
  }
  const double highest = surface.HighestMm();
  double t = std::isfinite(highest)
                 ? std::max(0.0, (highest - ray.origin_mm.z()) / ray.direction.z())
                 : 0.0;
  const double rate = ClosingRate(surface, ray);
  const double close_mm = 0.01 * surface.DetailMm();
  Gap gap = GapAt(surface, ray, t);
  for (int step = 0; step < kMaxTraceSteps; ++step) {
    if (gap.height_mm < close_mm && gap.rate < 0.0) {
      double root = t;
      Gap at_root = gap;
      for (int i = 0; i < kNewtonSteps && std::abs(at_root.height_mm) > kTouching_mm; ++i) {
        root -= at_root.height_mm / at_root.rate;
        at_root = GapAt(surface, ray, root);
        if (!(at_root.rate < 0.0) || root < t) {
          break;
        }
      }
      if (std::abs(at_root.height_mm) <= kTouching_mm && root - t < 4.0 * close_mm / rate) {
        return root;
      }
    }
    if (gap.height_mm <= 1e-9) {
      return t;
    }
    t += gap.height_mm / rate;
    gap = GapAt(surface, ray, t);
    if (!(t < kFarthest_mm) || ray.At(t).z() < surface.LowestMm() - 1.0) {
      return std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<double> NextHit(const Surface& surface, const Ray& ray, double distance_mm,
                              double finest_step) {
  const double rate = ClosingRate(surface, ray);
  if (rate <= 0.0) {
    return std::nullopt;
  }
  const double smallest = finest_step * surface.DetailMm();
  const double highest = surface.HighestMm();
  double t = smallest;
  for (int step = 0; step < kMaxTraceSteps && t < distance_mm; ++step) {
    const Eigen::Vector3d at = ray.At(t);
    if (at.z() > highest && ray.direction.z() >= 0.0) {
      return std::nullopt;
    }
    const double gap = at.z() - surface.At(at.x(), at.y()).height_mm;
    if (gap < 0.0) {
      return t;
    }
    t += std::max(gap / rate, smallest);
  }
  return std::nullopt;
}

bool IsVisible(const Surface& surface, const Eigen::Vector3d& point_mm,
               const Eigen::Vector3d& to_light, double distance_mm) {
  return !NextHit(surface, {point_mm, to_light}, distance_mm, kShadowEdge).has_value();
}

}  // namespace sateen
