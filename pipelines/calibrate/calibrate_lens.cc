#include "pipelines/calibrate/calibrate_lens.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/stopwatch.h"
#include "pipelines/calibrate/pictures/lens_pictures.h"
#include "pipelines/calibrate/rig_record.h"

namespace sateen {
namespace {

// Puts the lens into the rig; its pose, lights and all else stay as they are.
void PutLens(const Camera& lens, LensCalibration& result) {
  Rig& rig = result.rig;
  if (!rig.camera) {
    rig.camera = Camera{.model = "camera", .has_pose = false};
  } else {
    const bool has_near_light =
        std::any_of(rig.lights.begin(), rig.lights.end(),
                    [](const auto& l) { return l.model != LightModel::kDistant; });
    if (rig.camera->has_pose) {
      result.warnings.push_back(fmt::format(
          "the pose in the rig was found with the previous lens; run sateen calibrate pose again{}",
          has_near_light ? ", then sateen calibrate lights" : ""));
    }
    if (!(rig.camera->size_px == lens.size_px)) {
      result.warnings.push_back(
          fmt::format("the rig's camera had {} x {} px, these views {} x {}; sessions of the "
                      "previous size need "
                      "the previous rig",
                      rig.camera->size_px.width, rig.camera->size_px.height, lens.size_px.width,
                      lens.size_px.height));
    }
  }
  rig.camera->size_px = lens.size_px;
  rig.camera->fx = lens.fx;
  rig.camera->fy = lens.fy;
  rig.camera->cx = lens.cx;
  rig.camera->cy = lens.cy;
  rig.camera->distortion = lens.distortion;
}

void WarnOfPhotos(LensCalibration& result) {
  for (const RejectedPhoto& photo : result.found.rejected) {
    result.warnings.push_back(photo.name + " is not used: " + photo.reason);
  }
  for (const LensViewReport& view : result.fit.views) {
    if (!view.left_out.empty()) {
      result.warnings.push_back(view.name + " is not used: " + view.left_out);
    }
  }
  for (const std::string& other : result.found.ignored) {
    result.warnings.push_back("ignored: " + other);
  }
  result.warnings.insert(result.warnings.end(), result.fit.warnings.begin(),
                         result.fit.warnings.end());
}

Status CompareWithTruth(LensCalibration& result) {
  const Result<std::optional<Rig>> truth =
      ReadTrueRig(result.found.photos.front().files.front().path.parent_path().parent_path());
  if (!truth) {
    return tl::unexpected(truth.error());
  }
  if (*truth && (*truth)->camera) {
    const Camera& a = result.fit.camera;
    const Camera& b = *(*truth)->camera;
    result.focal_error = std::max(std::abs(a.fx / b.fx - 1.0), std::abs(a.fy / b.fy - 1.0));
    result.principal_error_px = std::hypot(a.cx - b.cx, a.cy - b.cy);
  }
  return {};
}

// Angle between the board's normal and the camera's axis.
double TiltDeg(const LensViewReport& view) {
  const Eigen::Vector3d& n = view.normal_in_camera;
  return std::atan2(n.head<2>().norm(), std::abs(n.z())) * kDegPerRad;
}

LensViewRecord RecordOfView(const LensViewReport& view) {
  const bool used = view.left_out.empty();
  LensViewRecord record{
      .name = view.name, .used = used, .corners = view.corners, .edge_px = view.edge_px};
  if (used) {
    record.rms_px = view.rms_px;
    record.held_out_px = view.held_out_px;
    record.tilt_deg = TiltDeg(view);
  } else {
    record.reason = view.left_out;
  }
  return record;
}

LensRecord RecordOf(const LensCalibration& result) {
  const LensFit& fit = result.fit;
  const Camera& lens = fit.camera;
  LensRecord record;
  FillCommon("lens", result, record);
  record.board = result.board.Text();
  record.size_px = {lens.size_px.width, lens.size_px.height};
  record.k = {lens.fx, lens.fy, lens.cx, lens.cy};
  record.k_sd = fit.pinhole_sd;
  record.distortion = lens.distortion;
  record.distortion_sd = fit.distortion_sd;
  record.corner_sd_px = fit.corner_sd_px;
  record.rms_px = fit.rms_px;
  record.held_out_rms_px = fit.held_out_rms_px;
  record.line_deviation_px = {.before = result.line_deviation.before_px,
                              .after = result.line_deviation.after_px};
  record.coverage = {.cells = {{fit.coverage.width, fit.coverage.height}},
                     .corners = fit.coverage.pixels};
  record.ignored = result.found.ignored;
  record.focal_error = result.focal_error;
  record.principal_error_px = result.principal_error_px;
  std::vector<LensViewRecord>& views = record.views.emplace();
  for (const LensViewReport& view : fit.views) {
    views.push_back(RecordOfView(view));
  }
  for (const RejectedPhoto& photo : result.found.rejected) {
    views.push_back({.name = photo.name, .used = false, .reason = photo.reason});
  }
  return record;
}

}  // namespace

Result<LensCalibration> CalibrateLensFromPhotos(const CalibrateLensOptions& options,
                                                const Task& task) {
  const Stopwatch stopwatch;
  LensCalibration result;
  BeginCalibration(options.output, "lens", result);
  Result<BoardSpec> board = ParseBoardSpec(options.board);
  if (!board) {
    return tl::unexpected(board.error());
  }
  result.board = *std::move(board);
  Result<Rig> rig = RigToBeginWith(options.rig_file, options.output);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  result.rig = *std::move(rig);
  Result<FoundBoards> found = FindBoards(options.photos, result.board, task);
  if (!found) {
    return tl::unexpected(found.error());
  }
  result.found = *std::move(found);
  task.BeginStage("fitting the lens", 1);
  Result<LensFit> fit = CalibrateLens(result.found.views, result.found.size_px);
  if (!fit) {
    Error error = fit.error();
    for (const RejectedPhoto& photo : result.found.rejected) {
      error.message += fmt::format("\n  {} is not used: {}", photo.name, photo.reason);
    }
    return tl::unexpected(std::move(error));
  }
  result.fit = *std::move(fit);
  result.sha256_of_input = result.found.sha256_of_input;
  WarnOfPhotos(result);
  PutLens(result.fit.camera, result);
  Status status = CompareWithTruth(result).and_then([&] { return DrawLens(result); }).and_then([&] {
    return task.CheckCancelled();
  });
  if (!status) {
    return tl::unexpected(status.error());
  }
  result.seconds = stopwatch.Seconds();
  result.record = RecordOf(result);
  status = RecordAndWrite(result.record, &CalibrationRecords::lens, result);
  if (!status) {
    return tl::unexpected(status.error());
  }
  return result;
}

}  // namespace sateen
