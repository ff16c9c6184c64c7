#include "calibration/pose_solve.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <optional>

#include "calibration/plane_map.h"
#include "core/angle.h"

namespace sateen {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int kMostSteps = 100;
constexpr double kStepTaken = 1e-12;  // relative fall of the cost that ends the steps
constexpr double kRadStep = 1e-6;     // of numeric derivatives
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
  for (int step = 0; step < kMostSteps && !settled; ++step) {
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
    for (int attempt = 0; attempt < kMostSteps; ++attempt) {
      Matrix6d damped = normal;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::Isometry3d next = Moved(result.camera_from_plane, -damped.ldlt().solve(slope));
      const Eigen::VectorXd at_next = ResidualsPx(camera, next, points_mm, corners_px);
      if (at_next.squaredNorm() < residuals.squaredNorm()) {
        settled =
            residuals.squaredNorm() - at_next.squaredNorm() < kStepTaken * residuals.squaredNorm();
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
  result.covariance =
      cost / std::max(2.0 * count - 6.0, 1.0) * normal.ldlt().solve(Matrix6d::Identity());
  return result;
}

// Both closed-form poses that put the plane before the camera, its front towards it.
std::vector<Eigen::Isometry3d> RoughPoses(const std::vector<Eigen::Vector3d>& points_mm,
                                          const std::vector<Eigen::Vector2d>& directions) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> seen;
  points.reserve(points_mm.size());
  seen.reserve(points_mm.size());
  for (size_t i = 0; i < points_mm.size(); ++i) {
    points.emplace_back(points_mm[i].x(), points_mm[i].y(), 0.0);
    seen.emplace_back(directions[i].x(), directions[i].y());
  }
  std::vector<cv::Vec3d> rotations;
  std::vector<cv::Vec3d> translations;
  cv::solvePnPGeneric(points, seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                      translations, false, cv::SOLVEPNP_IPPE);
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(rotations.size());
  for (size_t i = 0; i < rotations.size(); ++i) {
    const Eigen::Vector3d w(rotations[i][0], rotations[i][1], rotations[i][2]);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(w.norm(), w.stableNormalized()).toRotationMatrix();
    pose.translation() =
        Eigen::Vector3d(translations[i][0], translations[i][1], translations[i][2]);
    if (pose.translation().z() > 0.0 && pose.linear().col(2).dot(pose.translation()) < 0.0) {
      poses.push_back(pose);
    }
  }
  return poses;
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
  if (poses.size() == 1) {
    return poses[0];
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
