#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Pose of a plane in front of the camera.
struct PlanePose {
  Eigen::Isometry3d camera_from_plane = Eigen::Isometry3d::Identity();
  // Covariance of w [rad] and d [mm] in x_in_camera = exp(w) R x + t + d, for noise as large as
  // the residuals.
  Matrix6d covariance = Matrix6d::Zero();
  double rms_px = 0.0;  // root mean square length of the residuals
};

// Moves a pose a little: returns exp(w) R and t + d for a step (w, d).
[[nodiscard]] Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose,
                                      const Eigen::Matrix<double, 6, 1>& step);

/// Solves for the pose of points of the plane z = 0: minimizes the squared distances [px] between
/// where the lens shows them and where they were seen, by Levenberg and Marquardt's method. The
/// cost has two minima, about mirrored in the line of sight (Schweighofer and Pinz, "Robust pose
/// estimation from a planar target", PAMI 28(12), 2006). Both are refined and the better one is
/// returned.
///
/// lens     its table_from_camera is ignored
/// Errors   kDegenerate: fewer than 4 points, or all in one line; a corner that the lens's
///          distortion cannot show; two tilts that explain the picture equally well
[[nodiscard]] Result<PlanePose> SolvePlanePose(const Camera& lens,
                                               const std::vector<Eigen::Vector3d>& points_mm,
                                               const std::vector<Eigen::Vector2d>& corners_px);

}  // namespace sateen
