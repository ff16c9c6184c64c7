#include "cli/calibrate/calibrate_lens_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/angle.h"
#include "core/version.h"

namespace sateen::cli {
namespace {

// Between the board's normal and the camera's axis.
double TiltDeg(const LensViewReport& view) {
  const Eigen::Vector3d& n = view.normal_in_camera;
  return std::atan2(n.head<2>().norm(), std::abs(n.z())) * kDegPerRad;
}

nlohmann::json ViewToJson(const LensViewReport& view) {
  nlohmann::json json = {{"name", view.name}, {"used", view.left_out.empty()}};
  json["corners"] = view.corners;
  json["edge_px"] = view.edge_px;
  if (view.left_out.empty()) {
    json["rms_px"] = view.rms_px;
    json["held_out_px"] = view.held_out_px;
    json["tilt_deg"] = TiltDeg(view);
  } else {
    json["reason"] = view.left_out;
  }
  return json;
}

}  // namespace

std::string JsonReport(const CalibrateLensArgs& args, const LensCalibration& result) {
  const LensFit& fit = result.fit;
  const Camera& lens = fit.camera;
  nlohmann::json report = {
      {"schema", "sateen.calibrate.lens/1"},
      {"version", Version()},
      {"output", args.output.string()},
      {"former_rig", result.former_rig.string()},
      {"pictures", result.pictures.string()},
      {"board", result.board.Text()},
      {"size_px", {lens.size_px.width, lens.size_px.height}},
      {"k", {lens.fx, lens.fy, lens.cx, lens.cy}},
      {"k_sd", fit.pinhole_sd},
      {"distortion", lens.distortion},
      {"distortion_sd", fit.distortion_sd},
      {"corner_sd_px", fit.corner_sd_px},
      {"rms_px", fit.rms_px},
      {"held_out_rms_px", fit.held_out_rms_px},
      {"line_deviation_px",
       {{"before", result.line_deviation.before_px}, {"after", result.line_deviation.after_px}}},
      {"coverage",
       {{"cells", {fit.coverage.width, fit.coverage.height}}, {"corners", fit.coverage.pixels}}},
      {"seconds", result.seconds},
      {"warnings", result.warnings},
      {"ignored", result.found.ignored},
      {"inputs", result.sha256_of_input},
      {"views", nlohmann::json::array()}};
  for (const LensViewReport& view : fit.views) {
    report["views"].push_back(ViewToJson(view));
  }
  for (const RejectedPhoto& photo : result.found.rejected) {
    report["views"].push_back({{"name", photo.name}, {"used", false}, {"reason", photo.reason}});
  }
  if (result.focal_error) {
    report["focal_error"] = *result.focal_error;
    report["principal_error_px"] = *result.principal_error_px;
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibrateLensArgs& args, const LensCalibration& result) {
  const LensFit& fit = result.fit;
  const Camera& lens = fit.camera;
  size_t widest = 4;
  for (const LensViewReport& view : fit.views) {
    widest = std::max(widest, view.name.size());
  }
  std::string text = fmt::format("{:<{}} {:>8} {:>9} {:>12} {:>9} {:>9}\n", "view", widest,
                                 "corners", "error px", "held out px", "tilt deg", "edges px");
  size_t used = 0;
  for (const LensViewReport& view : fit.views) {
    if (view.left_out.empty()) {
      ++used;
      text += fmt::format("{:<{}} {:>8} {:>9.3f} {:>12.3f} {:>9.1f} {:>9.2f}\n", view.name, widest,
                          view.corners, view.rms_px, view.held_out_px, TiltDeg(view), view.edge_px);
    } else {
      text += fmt::format("{:<{}} {:>8} not used\n", view.name, widest, view.corners);
    }
  }
  for (const RejectedPhoto& photo : result.found.rejected) {
    text += fmt::format("{:<{}} {:>8} not used\n", photo.name, widest, "-");
  }
  text += fmt::format(
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
  text += fmt::format(
      "                 in the corners of the image known to {:.2f} px\n"
      "error {:.3f} px over {} views of {}, {:.3f} px where a view is held out\n"
      "rows of corners are up to {:.2f} px off straight lines, {:.2f} px without distortion\n",
      fit.corner_sd_px, fit.rms_px, used, fit.views.size() + result.found.rejected.size(),
      fit.held_out_rms_px, result.line_deviation.before_px, result.line_deviation.after_px);
  if (result.focal_error) {
    text += fmt::format(
        "error against truth/rig.json: focal length {:.3g} %, principal point {:.3g} px\n",
        100.0 * *result.focal_error, *result.principal_error_px);
  }
  if (!result.former_rig.empty()) {
    text += fmt::format("the former rig is kept as {}\n", result.former_rig.string());
  }
  text += fmt::format(
      "{} is written after {:.1f} s; look at coverage.png, residuals.png and "
      "undistorted.png in {}\n",
      args.output.string(), result.seconds, result.pictures.string());
  return text;
}

}  // namespace sateen::cli
