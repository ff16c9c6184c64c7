#include "cli/calibrate/calibrate_pose.h"

#include <CLI/CLI.hpp>

#include "cli/calibrate/calibration_report.h"
#include "core/angle.h"

namespace sateen::cli {
namespace {

std::string TextReport(const PoseCalibration& result) {
  const Eigen::Vector3d at_mm = result.rig.camera->table_from_camera.translation();
  const PoseFit& fit = result.fit;
  const Eigen::Vector3d sd_deg = fit.rotation_sd_rad * kDegPerRad;
  const size_t photographs = result.found.views.size();
  std::string text = fmt::format(
      "camera at        {:.2f}, {:.2f}, {:.2f} mm +- {:.3f}, {:.3f}, {:.3f}\n"
      "leaning by       {:.3f} degrees from straight down; rotation +- {:.4f}, {:.4f}, {:.4f} "
      "degrees about x, y, z\n"
      "at field's edge  a pixel's place on the table is known to +- {:.4f} mm, a light's direction "
      "or a normal to +- {:.4f} degrees\n"
      "corners          {} from {} photograph{}, off by {:.3f} px\n",
      at_mm.x(), at_mm.y(), at_mm.z(), fit.position_sd_mm[0], fit.position_sd_mm[1],
      fit.position_sd_mm[2], result.lean_deg, sd_deg[0], sd_deg[1], sd_deg[2], result.edge_sd_mm,
      fit.rotation_sd_rad.head<2>().norm() * kDegPerRad, result.corners, photographs,
      photographs == 1 ? "" : "s", fit.reprojection_rms_px);
  if (result.position_error_mm) {
    text +=
        fmt::format("error against truth/rig.json: position {:.3g} mm, rotation {:.3g} degrees\n",
                    *result.position_error_mm, *result.rotation_error_deg);
  }
  return text + FilesText(result, (result.pictures / "axes.png").string());
}

}  // namespace

void AddCalibratePose(CLI::App& calibrate, CalibratePoseArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "pose", "Position and rotation of the camera, from a board lying on the table");
  CalibratePoseOptions& options = args.options;
  cmd->add_option("photos", options.photos,
                  "A photograph, a session of kind board, or a folder of several of the same lying "
                  "board; its centre becomes the table's origin")
      ->required();
  cmd->add_option("--board", options.board,
                  "Board as for calibrate lens; default: the one that the rig's lens was "
                  "calibrated with");
  cmd->add_option("-o,--output", options.output,
                  "Rig file to write; one that exists is kept as a copy")
      ->required();
  cmd->add_option("--rig", options.rig_file, "Rig with the lens; default: the one at --output");
  cmd->add_option("--thickness", options.thickness_mm,
                  "Thickness of the board [mm]: the table lies this far below its print")
      ->capture_default_str();
  AddThreadsAndJson(*cmd, args.threads, args.json);
}

int RunCalibratePose(const CalibratePoseArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  const Result<PoseCalibration> result =
      CalibratePoseFromPhotos(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("pose", args.json, result, TextReport, out, log);
}

}  // namespace sateen::cli
