#include "pipelines/calibrate/calibrate_pose.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/stopwatch.h"
#include "pipelines/calibrate/pictures/pose_pictures.h"
#include "pipelines/calibrate/rig_record.h"
#include "rig/projection.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen {
namespace {

constexpr double kLargeErrorPx = 1.0;  // of the corners, larger than with a good lens
constexpr double kMuchLarger = 3.0;    // times the lens's own error
constexpr double kPoorRotationDeg = 0.02;
constexpr double kOtherScale = 0.05;  // of the camera's height: a board of another size
constexpr double kThickest = 100.0;   // [mm]

// Returns the board that is named, or else the one that the lens was calibrated with.
Result<BoardSpec> BoardOf(const CalibratePoseOptions& options, const Rig& rig) {
  if (!options.board.empty()) {
    return ParseBoardSpec(options.board);
  }
  const std::optional<LensRecord>& lens = rig.calibration.lens;
  if (!lens || !lens->board) {
    return Fail(ErrorCode::kInvalidArgument,
                "the rig does not say which board its lens was calibrated with; name it with "
                "--board");
  }
  return ParseBoardSpec(*lens->board);
}

// Angle between the camera's axis and straight down.
double LeanDeg(const Camera& camera) {
  const Eigen::Vector3d axis = camera.table_from_camera.linear().col(2);
  return std::atan2(axis.head<2>().norm(), -axis.z()) * kDegPerRad;
}

double AngleDeg(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear() * b.linear().transpose()).angle() * kDegPerRad;
}

// Returns the standard deviation of the place where a pixel's ray meets the table, in the worst
// corner of the image. Its derivatives by rotation and position are taken numerically.
double EdgeSdMm(const Camera& camera, const Matrix6d& covariance) {
  constexpr double kStep = 1e-6;
  double worst = 0.0;
  for (const int u : {0, camera.size_px.width - 1}) {
    for (const int v : {0, camera.size_px.height - 1}) {
      Eigen::Matrix<double, 2, 6> jacobian = Eigen::Matrix<double, 2, 6>::Zero();
      for (Eigen::Index k = 0; k < 6; ++k) {
        const auto point = [&](double step) {
          Camera moved = camera;
          const Eigen::Matrix<double, 6, 1> by = step * Eigen::Matrix<double, 6, 1>::Unit(k);
          moved.table_from_camera = Moved(camera.table_from_camera, by);
          return TablePointOfPixel(moved, u, v);
        };
        const auto ahead = point(kStep);
        const auto behind = point(-kStep);
        if (ahead && behind) {
          jacobian.col(k) = (*ahead - *behind).head<2>() / (2.0 * kStep);
        }
      }
      const Eigen::Matrix2d spread = jacobian * covariance * jacobian.transpose();
      worst = std::max(worst, std::sqrt(spread.trace()));
    }
  }
  return worst;
}

// Compares with the truth in the table frame of the board as it truly lies.
Status CompareWithTruth(const CalibratePoseOptions& options, PoseCalibration& result) {
  const std::filesystem::path session =
      result.found.photos.front().files.front().path.parent_path().parent_path();
  const Result<std::optional<Rig>> truth = ReadTrueRig(session);
  if (!truth) {
    return tl::unexpected(truth.error());
  }
  const Result<std::optional<Eigen::Isometry3d>> board = ReadTruePose(session);
  if (!board) {
    return tl::unexpected(board.error());
  }
  if (*truth && (*truth)->camera) {
    const Eigen::Isometry3d& a = result.rig.camera->table_from_camera;
    const Eigen::Isometry3d board_from_table =
        board->value_or(Eigen::Isometry3d::Identity()).inverse();
    Eigen::Isometry3d b =
        CameraFromTable((board_from_table * (*truth)->camera->table_from_camera).inverse())
            .inverse();
    b.translation().z() += options.thickness_mm;
    result.position_error_mm = (a.translation() - b.translation()).norm();
    result.rotation_error_deg = AngleDeg(a, b);
  }
  return {};
}

// Warns of a board printed larger or smaller than it says: the camera seems at another height.
void WarnOfScale(const Eigen::Isometry3d& pose, PoseCalibration& result) {
  const Camera& camera = *result.rig.camera;
  const double former_mm = camera.table_from_camera.translation().z();
  const double height_mm = pose.translation().z();
  if (camera.has_pose && std::abs(height_mm / former_mm - 1.0) > kOtherScale) {
    result.warnings.push_back(
        fmt::format("the camera stands {:.0f} mm above the table, {:.0f} mm by the previous pose: "
                    "unless it was "
                    "moved, the board is not of the size that {} says; measure its squares",
                    height_mm, former_mm, result.board.Text()));
  }
}

void PutPose(const CalibratePoseOptions& options, PoseCalibration& result) {
  Camera& camera = *result.rig.camera;
  Eigen::Isometry3d pose = result.fit.table_from_camera;
  pose.translation().z() += options.thickness_mm;  // the table lies under the board
  if (camera.has_pose) {
    result.moved_mm = (pose.translation() - camera.table_from_camera.translation()).norm();
    result.turned_deg = AngleDeg(pose, camera.table_from_camera);
    const bool has_near_light =
        std::any_of(result.rig.lights.begin(), result.rig.lights.end(),
                    [](const Light& light) { return light.model != LightModel::kDistant; });
    if (has_near_light) {
      result.warnings.push_back(fmt::format(
          "the table frame has changed: in it the camera is {:.2f} mm and {:.3f} degrees from its "
          "previous pose; the lights belong to the previous one: run sateen calibrate lights again",
          result.moved_mm, result.turned_deg));
    }
  }
  WarnOfScale(pose, result);
  camera.table_from_camera = pose;
  camera.has_pose = true;
  result.edge_sd_mm = EdgeSdMm(camera, result.fit.covariance);
  result.lean_deg = LeanDeg(camera);
}

void Warn(PoseCalibration& result) {
  for (const RejectedPhoto& photo : result.found.rejected) {
    result.warnings.push_back(photo.name + " is not used: " + photo.reason);
  }
  for (const std::string& other : result.found.ignored) {
    result.warnings.push_back("ignored: " + other);
  }
  const std::optional<LensRecord>& lens = result.rig.calibration.lens;
  const double usual_px = lens && lens->rms_px ? *lens->rms_px : kLargeErrorPx;
  const double error_px = result.fit.reprojection_rms_px;
  if (error_px > std::max(kMuchLarger * usual_px, 0.1) || error_px > kLargeErrorPx) {
    result.warnings.push_back(fmt::format(
        "the corners' error is {:.2f} px; it was {:.2f} px when the lens was calibrated: is the "
        "board flat, and was focus, zoom or aperture changed since?",
        error_px, usual_px));
  }
  const double rotation_deg = result.fit.rotation_sd_rad.norm() * kDegPerRad;
  if (rotation_deg > kPoorRotationDeg) {
    result.warnings.push_back(fmt::format(
        "the camera's rotation has a standard deviation of {:.3f} degrees; use a larger board or "
        "take a sharper picture",
        rotation_deg));
  }
}

PoseRecord RecordOf(const CalibratePoseOptions& options, const PoseCalibration& result) {
  const Eigen::Isometry3d& pose = result.rig.camera->table_from_camera;
  const PoseFit& fit = result.fit;
  PoseRecord record;
  FillCommon("pose", result, record);
  record.board = result.board.Text();
  record.thickness_mm = options.thickness_mm;
  record.photographs = result.found.views.size();
  record.corners = result.corners;
  std::ranges::copy(RowMajor(pose), record.table_from_camera.emplace().begin());
  record.lean_deg = result.lean_deg;
  record.rms_px = fit.reprojection_rms_px;
  record.position_sd_mm = fit.position_sd_mm;
  record.rotation_sd_deg = fit.rotation_sd_rad * kDegPerRad;
  record.edge_sd_mm = result.edge_sd_mm;
  record.moved_mm = result.moved_mm;
  record.turned_deg = result.turned_deg;
  record.position_error_mm = result.position_error_mm;
  record.rotation_error_deg = result.rotation_error_deg;
  return record;
}

}  // namespace

Result<PoseCalibration> CalibratePoseFromPhotos(const CalibratePoseOptions& options,
                                                const Task& task) {
  const Stopwatch stopwatch;
  PoseCalibration result;
  BeginCalibration(options.output, "pose", result);
  if (!(std::abs(options.thickness_mm) <= kThickest)) {
    return Fail(ErrorCode::kInvalidArgument, "--thickness {} mm; need 0 to {}",
                options.thickness_mm, kThickest);
  }
  Result<Rig> rig = RigToBeginWith(options.rig_file, options.output);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  result.rig = *std::move(rig);
  if (!result.rig.camera) {
    return Fail(ErrorCode::kBadData,
                "{}: has no camera; run sateen calibrate lens first, or name its rig with --rig",
                (options.rig_file.empty() ? options.output : options.rig_file).string());
  }
  Result<BoardSpec> board = BoardOf(options, result.rig);
  if (!board) {
    return tl::unexpected(board.error());
  }
  result.board = *std::move(board);
  Result<FoundBoards> found = FindBoards(options.photos, result.board, task);
  if (!found) {
    return tl::unexpected(found.error());
  }
  result.found = *std::move(found);
  const Result<BoardView> view = MeanView(result.found.views);
  const Result<PoseFit> fit =
      view.and_then([&](const BoardView& mean) { return FitPose(*result.rig.camera, mean); });
  if (!fit) {
    return tl::unexpected(fit.error());
  }
  result.corners = view->ids.size();
  result.fit = *fit;
  result.sha256_of_input = result.found.sha256_of_input;
  PutPose(options, result);
  Warn(result);
  Status status = CompareWithTruth(options, result)
                      .and_then([&] { return DrawPose(result, options.thickness_mm); })
                      .and_then([&] { return task.CheckCancelled(); });
  if (!status) {
    return tl::unexpected(status.error());
  }
  result.seconds = stopwatch.Seconds();
  result.record = RecordOf(options, result);
  status = RecordAndWrite(result.record, &CalibrationRecords::pose, result);
  if (!status) {
    return tl::unexpected(status.error());
  }
  return result;
}

}  // namespace sateen
