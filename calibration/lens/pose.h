#pragma once

#include <Eigen/Geometry>

#include "calibration/print/board_find.h"
#include "calibration/print/pose_solve.h"
#include "core/error.h"
#include "rig/camera.h"

namespace sateen {

struct PoseFit {
  Eigen::Isometry3d table_from_camera = Eigen::Isometry3d::Identity();
  // How the board lies: turned about z only, its centre at the origin.
  Eigen::Isometry3d table_from_board = Eigen::Isometry3d::Identity();
  // Of a small rotation about the table's axes (rad), which turns the camera in its place, and of
  // the camera's position (mm); and the standard deviations in it.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d rotation_sd_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_sd_mm = Eigen::Vector3d::Zero();
  double reprojection_rms_px = 0.0;
};

/// Where the camera stands, from one board that lies flat on the table.
///
/// The table frame depends on how the board lies only by the board's centre, which is the origin:
/// z is the board's normal, towards the camera; x is the camera's x axis (right in the image) laid
/// onto the table; y = z cross x, up in the image. So the camera's own x axis never leans in y.
/// The camera need not look straight down.
///
/// lens     its table_from_camera counts for nothing
/// Errors   as SolvePlanePose(); kInvalidArgument: another picture size than the lens's
[[nodiscard]] Result<PoseFit> FitPose(const Camera& lens, const BoardView& board);

// The table frame of a lying board, as FitPose() has it.
[[nodiscard]] Eigen::Isometry3d CameraFromTable(const Eigen::Isometry3d& camera_from_board);

/// The corners of several pictures of one board that nobody moved, each the mean of where it was
/// seen, in the order of their ids.
///
/// views    at least 1
/// Errors   kBadData: pictures of different sizes; a picture whose corners are, by the median, more
///          than half a pixel from the others': board or camera moved
[[nodiscard]] Result<BoardView> MeanView(const std::vector<BoardView>& views);

}  // namespace sateen
