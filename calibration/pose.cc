#include "calibration/pose.h"

namespace sateen {
namespace {

constexpr double kPoseStep = 1e-6;  // of numeric derivatives, rad or mm

Eigen::Isometry3d CameraFromTable(const Eigen::Isometry3d& camera_from_board) {
  const Eigen::Vector3d z = camera_from_board.linear().col(2);
  const Eigen::Vector3d x = (Eigen::Vector3d::UnitX() - z.x() * z).normalized();
  Eigen::Isometry3d camera_from_table = camera_from_board;
  camera_from_table.linear() << x, z.cross(x), z;
  return camera_from_table;
}

// Derivative of the camera's small rotation and position in the table frame by w and d of the
// pose solved for.
Matrix6d TableJacobian(const Eigen::Isometry3d& camera_from_board) {
  const auto table_from_camera = [&](const Eigen::Matrix<double, 6, 1>& step) {
    return CameraFromTable(Moved(camera_from_board, step)).inverse();
  };
  Matrix6d jacobian;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const Eigen::Matrix<double, 6, 1> step = kPoseStep * Eigen::Matrix<double, 6, 1>::Unit(k);
    const Eigen::Isometry3d ahead = table_from_camera(step);
    const Eigen::Isometry3d behind = table_from_camera(-step);
    const Eigen::Matrix3d turn = ahead.linear() * behind.linear().transpose();
    // The vector of a small rotation is its antisymmetric part.
    jacobian.col(k) << 0.5 * Eigen::Vector3d(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0),
                                             turn(1, 0) - turn(0, 1)),
        ahead.translation() - behind.translation();
  }
  return jacobian / (2.0 * kPoseStep);
}

}  // namespace

Result<PoseFit> FitPose(const Camera& lens, const BoardView& board) {
  if (!(board.size_px == lens.size_px)) {
    return Fail(
        ErrorCode::kInvalidArgument,
        "a picture of {} x {} px and a lens calibrated at {} x {}; use pictures of one size",
        board.size_px.width, board.size_px.height, lens.size_px.width, lens.size_px.height);
  }
  const Result<PlanePose> solved = SolvePlanePose(lens, board.points_mm, board.corners_px);
  if (!solved) {
    return tl::unexpected<Error>(solved.error());
  }
  PoseFit fit;
  fit.table_from_camera = CameraFromTable(solved->camera_from_plane).inverse();
  fit.table_from_board = fit.table_from_camera * solved->camera_from_plane;
  const Matrix6d jacobian = TableJacobian(solved->camera_from_plane);
  fit.covariance = jacobian * solved->covariance * jacobian.transpose();
  fit.rotation_sd_rad = fit.covariance.diagonal().head<3>().cwiseSqrt();
  fit.position_sd_mm = fit.covariance.diagonal().tail<3>().cwiseSqrt();
  fit.reprojection_rms_px = solved->rms_px;
  return fit;
}

}  // namespace sateen
