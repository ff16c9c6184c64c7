#include "rig/projection.h"

#include <algorithm>
#include <cmath>

namespace sateen {
namespace {

constexpr double kConverged = 1e-12;  // step of x and y; below 1e-8 px for any real lens
constexpr int kMaxSteps = 100;        // five are usual; more only beside the fold

// Equations (2) and (3), and their Jacobian, which is symmetric.
struct Distorted {
  Eigen::Vector2d x;
  Eigen::Matrix2d jacobian;
};

Distorted Distort(const std::array<double, 5>& distortion, const Eigen::Vector2d& at) {
  const auto [k1, k2, p1, p2, k3] = distortion;
  const double x = at.x();
  const double y = at.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);  // d radial / d r^2
  Distorted result;
  result.x = {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),   // (2)
              y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};  // (3)
  const double mixed = 2.0 * (x * y * slope + p1 * x + p2 * y);
  result.jacobian << radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed,  //
      mixed, radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
  return result;
}

// Returns whether the distorted radius r (1 + k1 r^2 + k2 r^4 + k3 r^6) still grows at every radius
// up to this one. Beyond, the model folds the image over and one pixel has several rays.
bool BeforeFold(const std::array<double, 5>& distortion, double r2) {
  const double a = 3.0 * distortion[0];
  const double b = 5.0 * distortion[1];
  const double c = 7.0 * distortion[4];
  const auto growth = [&](double s) { return 1.0 + s * (a + s * (b + s * c)); };
  // Its least value lies at the end or where its derivative a + 2 b s + 3 c s^2 is zero.
  double least = growth(r2);
  const auto look_at = [&](double s) {
    if (s > 0.0 && s < r2) {
      least = std::min(least, growth(s));
    }
  };
  const double discriminant = b * b - 3.0 * a * c;
  if (discriminant >= 0.0) {
    const double q = -(b + std::copysign(std::sqrt(discriminant), b));
    look_at(q / (3.0 * c));  // infinite or NaN, and so not looked at, where c = 0
    look_at(a / q);
  }
  return least > 0.0;
}

// Returns whether pixel and ray still determine each other.
bool IsInvertible(const std::array<double, 5>& distortion, const Eigen::Vector2d& x,
                  const Eigen::Matrix2d& jacobian) {
  return jacobian.determinant() > 0.0 && jacobian.trace() > 0.0 &&
         BeforeFold(distortion, x.squaredNorm());
}

// Inverts equations (2) and (3) by Newton steps from the centre. A step is halved where it leaves
// the invertible part or comes no closer. Nothing where the fold is in the way.
std::optional<Eigen::Vector2d> Undistort(const std::array<double, 5>& distortion,
                                         const Eigen::Vector2d& distorted) {
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  Distorted at_x = Distort(distortion, x);
  Eigen::Vector2d step = distorted;
  double share = 1.0;  // share of the step that is taken
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::Vector2d next_x = x + share * step;
    const Distorted at_next = Distort(distortion, next_x);
    const bool closer = (distorted - at_next.x).norm() <= (distorted - at_x.x).norm();
    const bool converged = share == 1.0 && step.lpNorm<Eigen::Infinity>() <= kConverged;
    if (!IsInvertible(distortion, next_x, at_next.jacobian) || (!closer && !converged)) {
      share /= 2.0;
      continue;
    }
    if (converged) {
      return next_x;
    }
    x = next_x;
    at_x = at_next;
    step = at_x.jacobian.inverse() * (distorted - at_x.x);
    share = 1.0;
  }
  return std::nullopt;
}

}  // namespace

Eigen::Vector2d PixelOfTablePoint(const Camera& camera, const Eigen::Vector3d& x_mm_in_table) {
  const Eigen::Vector3d p = camera.table_from_camera.inverse() * x_mm_in_table;
  const Eigen::Vector2d x = Distort(camera.distortion, p.head<2>() / p.z()).x;  // (1) to (3)
  return {camera.fx * x.x() + camera.cx, camera.fy * x.y() + camera.cy};        // (4)
}

std::optional<Eigen::Vector3d> RayOfPixel(const Camera& camera, double u, double v) {
  const std::optional<Eigen::Vector2d> x =
      Undistort(camera.distortion, {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy});
  if (!x) {
    return std::nullopt;
  }
  return camera.table_from_camera.linear() * x->homogeneous().normalized();
}

std::optional<Eigen::Vector3d> TablePointOfPixel(const Camera& camera, double u, double v,
                                                 double height_mm) {
  const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, u, v);
  if (!ray) {
    return std::nullopt;
  }
  const Eigen::Vector3d center = camera.table_from_camera.translation();
  const double distance_mm = (height_mm - center.z()) / ray->z();
  if (!(distance_mm > 0.0 && std::isfinite(distance_mm))) {
    return std::nullopt;
  }
  const Eigen::Vector3d point = center + distance_mm * *ray;
  return Eigen::Vector3d(point.x(), point.y(), height_mm);
}

Camera PinholeOf(const Camera& camera) {
  Camera pinhole = camera;
  pinhole.distortion = {};
  return pinhole;
}

std::optional<Eigen::Vector2d> PixelOfPinholePixel(const Camera& camera, double u, double v) {
  const Eigen::Vector2d x((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
  const Distorted at = Distort(camera.distortion, x);
  if (!IsInvertible(camera.distortion, x, at.jacobian)) {
    return std::nullopt;
  }
  return Eigen::Vector2d(camera.fx * at.x.x() + camera.cx, camera.fy * at.x.y() + camera.cy);
}

Camera OverheadCamera(ImageSize size_px, double distance_mm, double width_mm) {
  Camera camera;
  camera.model = "overhead";
  camera.size_px = size_px;
  camera.fx = camera.fy = size_px.width * distance_mm / width_mm;
  camera.cx = (size_px.width - 1) / 2.0;
  camera.cy = (size_px.height - 1) / 2.0;
  // Looks down: its y (down in the image) and z (forward) are the table's -y and -z.
  camera.table_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.table_from_camera.translation() = Eigen::Vector3d(0, 0, distance_mm);
  return camera;
}

}  // namespace sateen
