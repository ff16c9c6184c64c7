#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct PlanePose {
  Eigen::Isometry3d camera_from_plane = Eigen::Isometry3d::Identity();
  // Of w (rad) and d (mm) in x_in_camera = exp(w) R x + t + d, from the residuals themselves.
  Matrix6d covariance = Matrix6d::Zero();
  double rms_px = 0.0;  // length of the residuals
};

// exp(w) R and t + d: the pose, moved a little.
[[nodiscard]] Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose,
                                      const Eigen::Matrix<double, 6, 1>& step);

/// The pose of points of the plane z = 0 that minimises the squared distances, in pixels, between
/// where the lens shows them and where they were seen, by Levenberg and Marquardt's method. There
/// are two such poses, seldom far from each other's mirror image in the line of sight (Schweighofer
/// and Pinz, "Robust pose estimation from a planar target", PAMI 28(12), 2006): it starts from both,
/// and takes the better one.
///
/// lens     its table_from_camera counts for nothing
/// Errors   kDegenerate: fewer than 4 points or all in a line; a corner outside what the lens's
///          distortion can show; two tilts that explain the picture equally well
[[nodiscard]] Result<PlanePose> SolvePlanePose(const Camera& lens,
                                               const std::vector<Eigen::Vector3d>& points_mm,
                                               const std::vector<Eigen::Vector2d>& corners_px);

}  // namespace sateen
