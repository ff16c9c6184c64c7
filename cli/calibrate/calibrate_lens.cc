#include "cli/calibrate/calibrate_lens.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "cli/calibrate/calibrate_lens_pictures.h"
#include "cli/calibrate/calibrate_lens_report.h"
#include "core/output_folder.h"
#include "pipelines/calibrate/rig_record.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

// The lens in the rig; its pose, its lights and all else stay as they are.
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
          "the pose in the rig was found with the former lens; run sateen calibrate pose again{}",
          has_near_light ? ", then sateen calibrate lights" : ""));
    }
    if (!(rig.camera->size_px == lens.size_px)) {
      result.warnings.push_back(fmt::format(
          "the rig's camera had {} x {} px, these views {} x {}; captures of the former size need "
          "the former rig",
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
    result.warnings.push_back("left alone: " + other);
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

Result<LensCalibration> Calibrate(const CalibrateLensArgs& args, const Task& task) {
  const auto start = std::chrono::steady_clock::now();
  LensCalibration result;
  Result<BoardSpec> board = ParseBoardSpec(args.board);
  if (!board) {
    return tl::unexpected(board.error());
  }
  result.board = *std::move(board);
  Result<Rig> rig = RigToBeginWith(args.rig_file, args.output);
  if (!rig) {
    return tl::unexpected(rig.error());
  }
  result.rig = *std::move(rig);
  Result<FoundBoards> found = FindBoards(args.photos, result.board, task);
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
  result.pictures = args.output;
  result.pictures.replace_filename(args.output.stem().string() + "-lens");
  Status status = CompareWithTruth(result).and_then([&] { return DrawLens(result); });
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

void AddCalibrateLens(CLI::App& calibrate, CalibrateLensArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "lens", "Focal length, principal point and distortion from photographs of a board");
  cmd->add_option("photos", args.photos,
                  "Folder of photographs (JPEG, PNG, TIFF, EXR, camera RAW) or of sessions of kind "
                  "board: 15 or more, the board tilted each way and reaching into the corners")
      ->required();
  cmd->add_option("--board", args.board,
                  "chessboard:9x6:24mm (inner corners, square) or charuco:10x7:25mm:18mm (squares, "
                  "square, marker; then :DICT_5X5_250, :legacy)")
      ->required();
  cmd->add_option("-o,--output", args.output, "Rig file to write; a former one is kept as a copy")
      ->required();
  cmd->add_option("--rig", args.rig_file,
                  "Rig whose lights, pose and all else are kept; what is at --output already");
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunCalibrateLens(const CalibrateLensArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  Result<LensCalibration> result = Calibrate(args, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("lens", args, std::move(result), out, log);
}

}  // namespace sateen::cli
