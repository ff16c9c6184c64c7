#include "cli/calibrate/calibrate_lens.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cli/calibrate/calibration_report.h"

namespace sateen::cli {
namespace {

std::string ViewsTable(const std::vector<LensViewRecord>& views) {
  size_t widest = 4;
  for (const LensViewRecord& view : views) {
    widest = std::max(widest, view.name->size());
  }
  std::string text = fmt::format("{:<{}} {:>8} {:>9} {:>12} {:>9} {:>9}\n", "view", widest,
                                 "corners", "error px", "held out px", "tilt deg", "edges px");
  for (const LensViewRecord& view : views) {
    const std::string corners = view.corners ? std::to_string(*view.corners) : "-";
    text += fmt::format("{:<{}} {:>8} ", *view.name, widest, corners);
    text += *view.used ? fmt::format("{:>9.3f} {:>12.3f} {:>9.1f} {:>9.2f}\n", *view.rms_px,
                                     *view.held_out_px, *view.tilt_deg, *view.edge_px)
                       : "not used\n";
  }
  return text;
}

std::string LensText(const LensFit& fit) {
  const Camera& lens = fit.camera;
  std::string text = fmt::format(
      "focal length     {:.2f} +- {:.2f}, {:.2f} +- {:.2f} px\n"
      "principal point  {:.2f} +- {:.2f}, {:.2f} +- {:.2f} px\n",
      lens.fx, fit.pinhole_sd[0], lens.fy, fit.pinhole_sd[1], lens.cx, fit.pinhole_sd[2], lens.cy,
      fit.pinhole_sd[3]);
  constexpr std::array kNames = {"k1", "k2", "p1", "p2", "k3"};
  text += "distortion      ";
  for (size_t i = 0; i < kNames.size(); ++i) {
    text += fmt::format(" {} {:.5f} +- {:.5f}{}", kNames[i], lens.distortion[i],
                        fit.distortion_sd[i], i + 1 < kNames.size() ? "," : "\n");
  }
  return text + fmt::format("                 in the corners of the image known to {:.2f} px\n",
                            fit.corner_sd_px);
}

std::string TextReport(const LensCalibration& result) {
  const LensFit& fit = result.fit;
  const std::vector<LensViewRecord>& views = *result.record.views;
  const auto used = std::ranges::count_if(views, [](const auto& view) { return *view.used; });
  std::string text = ViewsTable(views) + LensText(fit);
  text += fmt::format(
      "error {:.3f} px over {} of {} views, {:.3f} px where a view is held out\n"
      "rows of corners are up to {:.2f} px off straight lines, {:.2f} px without distortion\n",
      fit.rms_px, used, views.size(), fit.held_out_rms_px, result.line_deviation.before_px,
      result.line_deviation.after_px);
  if (result.focal_error) {
    text += fmt::format(
        "error against truth/rig.json: focal length {:.3g} %, principal point {:.3g} px\n",
        100.0 * *result.focal_error, *result.principal_error_px);
  }
  return text + FilesText(result, "coverage.png, residuals.png and undistorted.png in " +
                                      result.pictures.string());
}

}  // namespace

void AddCalibrateLens(CLI::App& calibrate, CalibrateLensArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "lens", "Focal length, principal point and distortion from photographs of a board");
  CalibrateLensOptions& options = args.options;
  cmd->add_option("photos", options.photos,
                  "Folder of photographs (JPEG, PNG, TIFF, EXR, camera RAW) or of sessions of kind "
                  "board: 15 or more, the board tilted each way and reaching into the corners")
      ->required();
  cmd->add_option("--board", options.board,
                  "chessboard:9x6:24mm (inner corners, square) or charuco:10x7:25mm:18mm (squares, "
                  "square, marker; then :DICT_5X5_250, :legacy)")
      ->required();
  cmd->add_option("-o,--output", options.output,
                  "Rig file to write; one that exists is kept as a copy")
      ->required();
  cmd->add_option("--rig", options.rig_file,
                  "Rig to add the lens to; default: the one at --output");
  AddThreadsAndJson(*cmd, args.threads, args.json);
}

int RunCalibrateLens(const CalibrateLensArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  const Result<LensCalibration> result =
      CalibrateLensFromPhotos(args.options, task.WithThreads(args.threads));
  task.ClearProgress();
  return FinishCalibration("lens", args.json, result, TextReport, out, log);
}

}  // namespace sateen::cli
