#include "cli/calibrate/calibrate_pose.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "core/angle.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kLargeErrorPx = 1.0;  // of the corners, that a lens of this picture does not have
constexpr double kMuchLarger = 3.0;    // times the lens's own error
constexpr double kPoorRotationDeg = 0.02;
constexpr double kOtherScale = 0.05;  // of the camera's height: a board of another size
constexpr double kThickest = 100.0;   // [mm]

// The board that the lens was calibrated with, where none is named.
Result<BoardSpec> BoardOf(const CalibratePoseArgs& args, const Rig& rig) {
  if (!args.board.empty()) {
    return ParseBoardSpec(args.board);
  }
  const nlohmann::json recorded = RecordedFigure(rig, "lens", "board");
  if (!recorded.is_string()) {
    return Fail(ErrorCode::kInvalidArgument,
                "the rig does not say which board its lens was calibrated with; name it with "
                "--board");
  }
  return ParseBoardSpec(recorded.get<std::string>());
}

double AngleDeg(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear() * b.linear().transpose()).angle() * kDegPerRad;
}

// Where a pixel's ray meets the table, and how it moves with a small step of the pose: of its
// rotation about the table's axes and of its position, as PoseFit's covariance has them.
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

// In the table frame of the board as it truly lies.
Status CompareWithTruth(const CalibratePoseArgs& args, PoseCalibration& result) {
  const fs::path session =
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
    b.translation().z() += args.thickness_mm;
    result.position_error_mm = (a.translation() - b.translation()).norm();
    result.rotation_error_deg = AngleDeg(a, b);
  }
  return {};
}

// A board printed larger or smaller than it says looks like a camera at another height.
void WarnOfScale(const Eigen::Isometry3d& pose, PoseCalibration& result) {
  const Camera& camera = *result.rig.camera;
  const double former_mm = camera.table_from_camera.translation().z();
  const double height_mm = pose.translation().z();
  if (camera.has_pose && std::abs(height_mm / former_mm - 1.0) > kOtherScale) {
    result.warnings.push_back(fmt::format(
        "the camera stands {:.0f} mm above the table, {:.0f} mm by the former pose: where it was "
        "not moved, the board is not of the size that {} says; measure its squares",
        height_mm, former_mm, result.board.Text()));
  }
}

void PutPose(const CalibratePoseArgs& args, PoseCalibration& result) {
  Camera& camera = *result.rig.camera;
  Eigen::Isometry3d pose = result.fit.table_from_camera;
  pose.translation().z() += args.thickness_mm;  // the table lies under the board
  if (camera.has_pose) {
    result.moved_mm = (pose.translation() - camera.table_from_camera.translation()).norm();
    result.turned_deg = AngleDeg(pose, camera.table_from_camera);
    const bool has_near_light =
        std::any_of(result.rig.lights.begin(), result.rig.lights.end(),
                    [](const Light& light) { return light.model != LightModel::kDistant; });
    if (has_near_light) {
      result.warnings.push_back(fmt::format(
          "the table frame is a new one (the camera is {:.2f} mm and {:.3f} degrees from its "
          "former "
          "place in it); the lights were found in the former: run sateen calibrate lights again",
          result.moved_mm, result.turned_deg));
    }
  }
  WarnOfScale(pose, result);
  camera.table_from_camera = pose;
  camera.has_pose = true;
  result.edge_sd_mm = EdgeSdMm(camera, result.fit.covariance);
}

void Warn(PoseCalibration& result) {
  for (const RejectedPhoto& photo : result.found.rejected) {
    result.warnings.push_back(photo.name + " is not used: " + photo.reason);
  }
  for (const std::string& other : result.found.ignored) {
    result.warnings.push_back("left alone: " + other);
  }
  const nlohmann::json lens_error = RecordedFigure(result.rig, "lens", "rms_px");
  const double usual_px = lens_error.is_number() ? lens_error.get<double>() : kLargeErrorPx;
  const double error_px = result.fit.reprojection_rms_px;
  if (error_px > std::max(kMuchLarger * usual_px, 0.1) || error_px > kLargeErrorPx) {
    result.warnings.push_back(fmt::format(
        "corners are off by {:.2f} px, by {:.2f} px when the lens was calibrated: is the "
        "board flat, and was focus, zoom or aperture changed since?",
        error_px, usual_px));
  }
  const double rotation_deg = result.fit.rotation_sd_rad.norm() * kDegPerRad;
  if (rotation_deg > kPoorRotationDeg) {
    result.warnings.push_back(fmt::format(
        "the camera's rotation is known to {:.3f} degrees only; lay down a larger board "
        "or take a sharper picture",
        rotation_deg));
  }
}

Result<PoseCalibration> Calibrate(const CalibratePoseArgs& args, const Task& task) {
  const auto start = std::chrono::steady_clock::now();
  PoseCalibration result;
  if (!(std::abs(args.thickness_mm) <= kThickest)) {
    return Fail(ErrorCode::kInvalidArgument, "--thickness {} mm; need 0 to {}", args.thickness_mm,
                kThickest);
  }
  Result<Rig> rig = RigToBeginWith(args.rig_file, args.output);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  result.rig = *std::move(rig);
  if (!result.rig.camera) {
    return Fail(ErrorCode::kBadData,
                "{}: has no camera; run sateen calibrate lens first, or name its rig with --rig",
                (args.rig_file.empty() ? args.output : args.rig_file).string());
  }
  Result<BoardSpec> board = BoardOf(args, result.rig);
  if (!board) {
    return tl::unexpected(board.error());
  }
  result.board = *std::move(board);
  Result<FoundBoards> found = FindBoards(args.photos, result.board, task);
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
  PutPose(args, result);
  Warn(result);
  result.pictures = args.output;
  result.pictures.replace_filename(args.output.stem().string() + "-pose");
  Status status =
      CompareWithTruth(args, result).and_then([&] { return DrawPose(result, args.thickness_mm); });
  if (status) {
    status = task.CheckCancelled();
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace

void AddCalibratePose(CLI::App& calibrate, CalibratePoseArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "pose", "Where camera and table are to each other, from a board lying on the table");
  cmd->add_option("photos", args.photos,
                  "A photograph, a session of kind board, or a folder of several of the same lying "
                  "board; its centre becomes the table's origin")
      ->required();
  cmd->add_option("--board", args.board,
                  "As for calibrate lens; the board that the rig's lens was calibrated with");
  cmd->add_option("-o,--output", args.output, "Rig file to write; a former one is kept as a copy")
      ->required();
  cmd->add_option("--rig", args.rig_file, "Rig with the lens; what is at --output already");
  cmd->add_option("--thickness", args.thickness_mm,
                  "Thickness of the board in mm: the table lies so much below its print")
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of words");
}

int RunCalibratePose(const CalibratePoseArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  Result<PoseCalibration> result = Calibrate(args, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("pose", args, std::move(result), out, log);
}

}  // namespace sateen::cli
