#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "core/angle.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "rig/projection.h"

// Photographs of two chrome spheres, ray by ray through a camera with a lens.
namespace sateen::testing {

inline constexpr double kRadiusMm = 30.0;
inline constexpr int kFine = 2;  // rays along each side of a pixel

inline double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kRadPerDeg;
}

// Sees 300 mm of the table from 600 mm, with a lens that bends the image's corners by 3 px.
inline Camera SphereCamera() {
  Camera camera = OverheadCamera({1500, 1000}, 600.0, 300.0);
  camera.distortion = {-0.05, 0.01, 0.0005, -0.0003, 0.0};
  return camera;
}

inline const std::vector<Eigen::Vector3d>& Centers() {
  static const std::vector<Eigen::Vector3d> centers = {{-85.0, 35.0, 30.0}, {90.0, -40.0, 30.0}};
  return centers;
}

// Returns the light that a ray sees on one sphere. A ray beside the sphere gives nothing. Otherwise
// it sees the lamps' mirror images, each a bell of one degree about where it lies as seen from the
// place of reflection.
inline std::optional<double> Mirrored(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray,
                                      const Eigen::Vector3d& center,
                                      const std::vector<Eigen::Vector3d>& lamps) {
  const double b = ray.dot(origin - center);
  const double root = b * b - (origin - center).squaredNorm() + kRadiusMm * kRadiusMm;
  if (root <= 0.0) {
    return std::nullopt;
  }
  const Eigen::Vector3d hit = origin + (-b - std::sqrt(root)) * ray;
  const Eigen::Vector3d normal = (hit - center) / kRadiusMm;
  const Eigen::Vector3d mirrored = ray - 2.0 * ray.dot(normal) * normal;
  double value = 0.02;
  for (const Eigen::Vector3d& lamp : lamps) {
    value += std::exp(-std::pow(AngleDeg(mirrored, lamp - hit), 2));
  }
  return value;
}

// Chrome spheres on a grey table under these lamps; `exposure` above 1 saturates the highlights.
inline Image<float> RenderSpheres(const std::vector<Eigen::Vector3d>& lamps,
                                  double exposure = 0.9) {
  const Camera camera = SphereCamera();
  const Eigen::Vector3d origin = camera.table_from_camera.translation();
  Image<float> gray(camera.size_px, 0.3F);
  for (const Eigen::Vector3d& center : Centers()) {
    const Eigen::Vector2d at = PixelOfTablePoint(camera, center);
    for (int y = 0; y < gray.height; ++y) {
      for (int x = 0; x < gray.width; ++x) {
        if ((Eigen::Vector2d(x, y) - at).norm() > 200.0) {
          continue;
        }
        double sum = 0.0;
        for (int fine = 0; fine < kFine * kFine; ++fine) {
          const double u = x + (fine % kFine + 0.5) / kFine - 0.5;
          const double v = y + (fine / kFine + 0.5) / kFine - 0.5;
          const std::optional<double> seen =
              Mirrored(origin, RayOfPixel(camera, u, v).value(), center, lamps);
          sum += seen ? std::min(1.0, exposure * *seen) : 0.3;
        }
        gray.At(x, y) = static_cast<float>(sum / (kFine * kFine));
      }
    }
  }
  return gray;
}

}  // namespace sateen::testing
