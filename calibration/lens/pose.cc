#include "calibration/lens/pose.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/check.h"
#include "core/statistics.h"

namespace sateen {
namespace {

constexpr double kPoseStep = 1e-6;  // of central differences, rad or mm

// Returns the derivatives of the camera's small rotation and position in the table frame by w and d
// of the pose that was solved for.
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

constexpr double kStillPx = 0.5;

}  // namespace

Eigen::Isometry3d CameraFromTable(const Eigen::Isometry3d& camera_from_board) {
  const Eigen::Vector3d z = camera_from_board.linear().col(2);
  const Eigen::Vector3d x = (Eigen::Vector3d::UnitX() - z.x() * z).normalized();
  Eigen::Isometry3d camera_from_table = camera_from_board;
  camera_from_table.linear() << x, z.cross(x), z;
  return camera_from_table;
}

Result<BoardView> MeanView(const std::vector<BoardView>& views) {
  SATEEN_CHECK(!views.empty());
  std::map<int, std::pair<Eigen::Vector2d, int>> sums;
  for (const BoardView& view : views) {
    if (!(view.size_px == views[0].size_px)) {
      return Fail(ErrorCode::kBadData, "{} is {} x {} px, {} is {} x {}; use pictures of one size",
                  view.name, view.size_px.width, view.size_px.height, views[0].name,
                  views[0].size_px.width, views[0].size_px.height);
    }
    std::vector<double> off_px;
    for (size_t i = 0; i < view.ids.size(); ++i) {
      auto [sum, is_new] = sums.try_emplace(view.ids[i], Eigen::Vector2d::Zero(), 0);
      if (!is_new) {
        const Eigen::Vector2d mean = sum->second.first / sum->second.second;
        off_px.push_back((view.corners_px[i] - mean).norm());
      }
      sum->second.first += view.corners_px[i];
      ++sum->second.second;
    }
    const double median_px = off_px.empty() ? 0.0 : Median(std::move(off_px));
    if (median_px > kStillPx) {
      return Fail(
          ErrorCode::kBadData,
          "{}: its corners are {:.1f} px from those of the photographs before it; the board or the "
          "camera moved: use photographs of one board that lies still, or one photograph",
          view.name, median_px);
    }
  }
  BoardView mean = views[0];
  mean.ids.clear();
  mean.corners_px.clear();
  mean.points_mm.clear();
  for (const auto& [id, sum] : sums) {
    mean.ids.push_back(id);
    mean.corners_px.emplace_back(sum.first / sum.second);
  }
  for (const BoardView& view : views) {
    for (size_t i = 0; i < view.ids.size(); ++i) {
      const auto at = std::lower_bound(mean.ids.begin(), mean.ids.end(), view.ids[i]);
      mean.points_mm.resize(mean.ids.size());
      mean.points_mm[static_cast<size_t>(at - mean.ids.begin())] = view.points_mm[i];
    }
  }
  return mean;
}

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
