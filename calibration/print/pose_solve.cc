#include "calibration/print/pose_solve.h"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>

#include "calibration/print/plane_map.h"
#include "core/angle.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"

namespace sateen {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int kMostPoseSteps = 100;
constexpr double kPoseStepTaken = 1e-12;  // relative fall of the cost that ends the steps
constexpr double kRadStep = 1e-6;         // of numeric derivatives
constexpr double kMmStep = 1e-4;
constexpr double kSamePose = 0.1 * kRadPerDeg;
constexpr double kClearlyWorse = 9.0;  // variances: 3 standard deviations

Eigen::VectorXd ResidualsPx(const Camera& camera, const Eigen::Isometry3d& pose,
                            const std::vector<Eigen::Vector3d>& points_mm,
                            const std::vector<Eigen::Vector2d>& corners_px) {
  Eigen::VectorXd residuals(2 * static_cast<Eigen::Index>(points_mm.size()));
  for (size_t i = 0; i < points_mm.size(); ++i) {
    residuals.segment<2>(2 * static_cast<Eigen::Index>(i)) =
        PixelOfTablePoint(camera, pose * points_mm[i]) - corners_px[i];
  }
  return residuals;
}

PlanePose RefinedPose(const Camera& camera, const Eigen::Isometry3d& start,
                      const std::vector<Eigen::Vector3d>& points_mm,
                      const std::vector<Eigen::Vector2d>& corners_px) {
  PlanePose result;
  result.camera_from_plane = start;
  Eigen::VectorXd residuals = ResidualsPx(camera, start, points_mm, corners_px);
  Eigen::Matrix<double, Eigen::Dynamic, 6> jacobian(residuals.size(), 6);
  Matrix6d normal = Matrix6d::Zero();
  double damping = 1e-6;
  bool settled = false;
  for (int step = 0; step < kMostPoseSteps && !settled; ++step) {
    for (Eigen::Index k = 0; k < 6; ++k) {
      const double h = k < 3 ? kRadStep : kMmStep;
      const Vector6d move = h * Vector6d::Unit(k);
      jacobian.col(k) =
          (ResidualsPx(camera, Moved(result.camera_from_plane, move), points_mm, corners_px) -
           ResidualsPx(camera, Moved(result.camera_from_plane, -move), points_mm, corners_px)) /
          (2.0 * h);
    }
    normal = jacobian.transpose() * jacobian;
    const Vector6d slope = jacobian.transpose() * residuals;
    settled = true;
    for (int attempt = 0; attempt < kMostPoseSteps; ++attempt) {
      Matrix6d damped = normal;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::Isometry3d next =
          Moved(result.camera_from_plane, -SolveSymmetric(damped, slope));
      const Eigen::VectorXd at_next = ResidualsPx(camera, next, points_mm, corners_px);
      if (at_next.squaredNorm() < residuals.squaredNorm()) {
        settled = residuals.squaredNorm() - at_next.squaredNorm() <
                  kPoseStepTaken * residuals.squaredNorm();
        result.camera_from_plane = next;
        residuals = at_next;
        damping = std::max(damping / 10.0, 1e-12);
        break;
      }
      damping *= 10.0;
      if (damping > 1e6) {
        break;
      }
    }
  }
  const double cost = residuals.squaredNorm();
  const auto count = static_cast<double>(points_mm.size());
  result.rms_px = std::sqrt(cost / count);
  result.covariance = cost / std::max(2.0 * count - 6.0, 1.0) * InverseOfSymmetric(normal);
  return result;
}

// The pose that the plane's map decomposes into, and the other one that looks much the same: with the
// plane's normal mirrored in the line of sight. None where the plane shows its back.
std::vector<Eigen::Isometry3d> RoughPoses(const std::vector<Eigen::Vector3d>& points_mm,
                                          const std::vector<Eigen::Vector2d>& directions) {
  const std::optional<PlaneMap> found = FitPlaneMap(points_mm, directions);
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points_mm) {
    center_mm += point / static_cast<double>(points_mm.size());
  }
  if (!found) {
    return {};
  }
  PlaneMap map = *found * (2.0 / (found->col(0).norm() + found->col(1).norm()));
  if ((map * Eigen::Vector3d(center_mm.x(), center_mm.y(), 1.0)).z() < 0.0) {
    map = -map;  // the plane lies before the camera
  }
  Eigen::Matrix3d axes;
  axes << map.leftCols<2>(), map.col(0).cross(map.col(1));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = NearestOrthogonal(axes);
  pose.translation() = map.col(2);
  const Eigen::Vector3d seen_at = pose * center_mm;
  const Eigen::Vector3d normal = pose.linear().col(2);
  if (!(normal.dot(seen_at) < 0.0)) {
    return {};
  }
  const Eigen::Vector3d sight = seen_at.normalized();
  const Eigen::Vector3d mirrored = 2.0 * normal.dot(sight) * sight - normal;
  Eigen::Isometry3d other = pose;
  other.linear() = Eigen::Quaterniond::FromTwoVectors(normal, mirrored) * pose.linear();
  other.translation() = seen_at - other.linear() * center_mm;
  return {pose, other};
}

}  // namespace

Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose, const Vector6d& step) {
  const Eigen::Vector3d w = step.head<3>();
  Eigen::Isometry3d moved = pose;
  moved.linear() = Eigen::AngleAxisd(w.norm(), w.stableNormalized()) * pose.linear();
  moved.translation() += step.tail<3>();
  return moved;
}

Result<PlanePose> SolvePlanePose(const Camera& lens, const std::vector<Eigen::Vector3d>& points_mm,
                                 const std::vector<Eigen::Vector2d>& corners_px) {
  if (!FitPlaneMap(points_mm, corners_px)) {
    return Fail(ErrorCode::kDegenerate,
                "a pose from {} points; need 4 that do not lie in one line: show more of the board",
                points_mm.size());
  }
  Camera camera = lens;
  camera.table_from_camera.setIdentity();
  std::vector<Eigen::Vector2d> directions;
  directions.reserve(corners_px.size());
  for (const Eigen::Vector2d& corner : corners_px) {
    const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, corner.x(), corner.y());
    if (!ray) {
      return Fail(ErrorCode::kDegenerate,
                  "a corner at ({:.1f}, {:.1f}) px, which the lens's distortion cannot show; the "
                  "lens is not that of this picture",
                  corner.x(), corner.y());
    }
    directions.push_back(ray->hnormalized());
  }
  std::vector<PlanePose> poses;
  poses.reserve(2);
  for (const Eigen::Isometry3d& rough : RoughPoses(points_mm, directions)) {
    poses.push_back(RefinedPose(camera, rough, points_mm, corners_px));
  }
  if (poses.empty()) {
    return Fail(
        ErrorCode::kDegenerate,
        "no pose puts the board's printed side before the camera; is the picture mirrored?");
  }
  if (poses[1].rms_px < poses[0].rms_px) {
    std::swap(poses[0], poses[1]);
  }
  const auto count = static_cast<double>(points_mm.size());
  const auto cost = [&](size_t i) { return count * poses[i].rms_px * poses[i].rms_px; };
  const Eigen::AngleAxisd apart(poses[0].camera_from_plane.linear() *
                                poses[1].camera_from_plane.linear().transpose());
  const double variance = cost(0) / std::max(2.0 * count - 6.0, 1.0);
  if (apart.angle() > kSamePose && cost(1) - cost(0) < kClearlyWorse * variance) {
    return Fail(ErrorCode::kDegenerate,
                "two tilts, {:.1f} degrees apart, explain the picture equally well; show the board "
                "larger",
                apart.angle() * kDegPerRad);
  }
  return poses[0];
}

}  // namespace sateen
