#include "calibration/print/pose_solve.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "calibration/print/plane_map.h"
#include "core/angle.h"
#include "core/gauss_newton.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"

namespace sateen {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kRadStep = 1e-6;  // of central differences
constexpr double kMmStep = 1e-4;
constexpr double kSamePose = 0.1 * kRadPerDeg;
constexpr double kClearlyWorse = 9.0;  // variances: 3 standard deviations

// Returns the normal equations of the distances [px] between corners as seen and as `pose` has
// them.
NormalEquations<6> PoseEquations(const Camera& camera, const Eigen::Isometry3d& pose,
                                 const std::vector<Eigen::Vector3d>& points_mm,
                                 const std::vector<Eigen::Vector2d>& corners_px) {
  std::array<std::pair<Eigen::Isometry3d, Eigen::Isometry3d>, 6> beside;
  for (size_t k = 0; k < 6; ++k) {
    const Vector6d step =
        (k < 3 ? kRadStep : kMmStep) * Vector6d::Unit(static_cast<Eigen::Index>(k));
    beside[k] = {Moved(pose, step), Moved(pose, -step)};
  }
  NormalEquations<6> equations;
  for (size_t i = 0; i < points_mm.size(); ++i) {
    const Eigen::Vector2d residual = corners_px[i] - PixelOfTablePoint(camera, pose * points_mm[i]);
    Eigen::Matrix<double, 6, 2> jacobian;
    for (size_t k = 0; k < 6; ++k) {
      jacobian.row(static_cast<Eigen::Index>(k)) =
          (PixelOfTablePoint(camera, beside[k].first * points_mm[i]) -
           PixelOfTablePoint(camera, beside[k].second * points_mm[i])) /
          (2.0 * (k < 3 ? kRadStep : kMmStep));
    }
    equations.Add(jacobian.col(0), residual.x());
    equations.Add(jacobian.col(1), residual.y());
  }
  return equations;
}

PlanePose RefinedPose(const Camera& camera, const Eigen::Isometry3d& start,
                      const std::vector<Eigen::Vector3d>& points_mm,
                      const std::vector<Eigen::Vector2d>& corners_px) {
  const auto fit = MinimizeSquares<6>(start,
                                      [&](const Eigen::Isometry3d& pose) {
                                        return PoseEquations(camera, pose, points_mm, corners_px);
                                      },
                                      Moved, {.rule = StepRule::kDamping, .max_iterations = 100});
  const auto count = static_cast<double>(points_mm.size());
  const double variance = fit.equations.cost / std::max(2.0 * count - 6.0, 1.0);
  return {.camera_from_plane = fit.state,
          .covariance = variance * InverseOfSymmetric(fit.equations.information),
          .rms_px = std::sqrt(fit.equations.cost / count)};
}

// Decomposes the plane's map into a pose, and adds the one that looks much the same: with the
// normal mirrored in the line of sight. Returns none where the plane shows its back.
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
    map = -map;  // the plane is in front of the camera
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
    return Fail(
        ErrorCode::kDegenerate,
        "{} points, or all in one line; need 4 that do not lie in one line: show more of the board",
        points_mm.size());
  }
  Camera camera = lens;
  camera.table_from_camera.setIdentity();
  std::vector<Eigen::Vector2d> directions;
  directions.reserve(corners_px.size());
  for (const Eigen::Vector2d& corner : corners_px) {
    const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, corner.x(), corner.y());
    if (!ray) {
      return Fail(
          ErrorCode::kDegenerate,
          "the lens's distortion cannot show the corner at ({:.1f}, {:.1f}) px; is this the "
          "lens of the picture?",
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
    return Fail(ErrorCode::kDegenerate,
                "no pose shows the board's printed side to the camera; is the picture mirrored?");
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
