#pragma once

#include <Eigen/Geometry>

#include "calibration/print/board_find.h"
#include "calibration/print/pose_solve.h"
#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

// Pose of the camera over the table.
struct PoseFit {
  Eigen::Isometry3d table_from_camera = Eigen::Isometry3d::Identity();
  // Pose of the board: turned about z only, its centre at the origin.
  Eigen::Isometry3d table_from_board = Eigen::Isometry3d::Identity();
  // Covariance of a small rotation about the table's axes [rad], which turns the camera in its
  // place, and of the camera's position [mm]; and the standard deviations in it.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d rotation_sd_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  double reprojection_rms_px = 0.0;
};

/// Fits the pose of the camera to one board that lies flat on the table.
///
/// The board's centre is the origin of the table frame, whichever way the board is turned. z is the
/// board's normal, towards the camera; x is the camera's x axis (right in the image) projected onto
/// the table; y = z cross x is up in the image. The camera need not look straight down.
///
/// lens     its table_from_camera is ignored
/// Errors   as SolvePlanePose(); kInvalidArgument: another picture size than the lens's
[[nodiscard]] Result<PoseFit> FitPose(const Camera& lens, const BoardView& board);

// Returns the table frame of a board that lies on the table, as FitPose() defines it.
[[nodiscard]] Eigen::Isometry3d CameraFromTable(const Eigen::Isometry3d& camera_from_board);

/// Averages the corners of several pictures of one board that did not move, in the order of their
/// ids.
///
/// views    at least 1
/// Errors   kBadData: pictures of different sizes; a picture whose corners are more than half a
///          pixel from the others', in the median: board or camera moved
[[nodiscard]] Result<BoardView> MeanView(const std::vector<BoardView>& views);

}  // namespace sateen
