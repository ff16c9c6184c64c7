#include "pipelines/calibrate/sheet_figures.h"

#include <cmath>
#include <utility>

#include "calibration/sheet/sheet_fault.h"
#include "core/angle.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen {
namespace {

double TiltDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegPerRad;
}

Eigen::Vector3d NormalOf(const SheetPose& pose) { return pose.table_from_sheet.linear().col(2); }

double TiltSdDeg(const SheetPose& pose) {
  return pose.rotation_sd_rad.head<2>().norm() * kDegPerRad;
}

}  // namespace

Result<SheetFigures> FiguresOfSheet(const std::filesystem::path& dir, const Sheet& sheet) {
  SheetFigures figures{.name = dir.string(), .pose = sheet.found_pose.value()};
  const Result<std::optional<Eigen::Isometry3d>> truth = ReadTruePose(dir);
  if (!truth) {
    return tl::unexpected(truth.error());
  }
  if (*truth) {
    figures.tilt_error_deg = TiltDeg(NormalOf(figures.pose), (*truth)->linear().col(2));
    figures.position_error_mm =
        (figures.pose.table_from_sheet.translation() - (*truth)->translation()).norm();
  }
  return figures;
}

std::optional<std::string> FaultOfSheet(const std::filesystem::path& dir, const Sheet& sheet,
                                        const Lights& lights, double albedo) {
  const std::optional<SheetFault> fault = FindSheetFault({.columns = sheet.grid.columns,
                                                          .rows = sheet.grid.rows,
                                                          .samples = sheet.samples,
                                                          .blocks = sheet.blocks},
                                                         lights, albedo);
  if (!fault) {
    return std::nullopt;
  }
  const std::string place =
      fmt::format("about x = {:.0f}, y = {:.0f} mm", fault->center_mm.x(), fault->center_mm.y());
  const std::string what =
      fault->shape == FaultShape::kRim ? "along its rim: does the paper end there?"
      : fault->shape == FaultShape::kLine
          ? fmt::format("along a line {:.0f} mm long and {:.0f} mm wide {}: is it a fold?",
                        fault->length_mm, fault->width_mm, place)
          : fmt::format("{}, over {:.0f} x {:.0f} mm: dust, a stain or a bump?", place,
                        fault->length_mm, fault->width_mm);
  return fmt::format(
      "{}: {:.1f} % of the sheet does not follow the lights, most of all under "
      "'{}', and is left out: {}",
      dir.string(), 100.0 * fault->share, lights[fault->worst_light].name, what);
}

std::string SheetsTable(const std::vector<SheetFigures>& sheets) {
  if (sheets.empty()) {
    return "";
  }
  std::string text =
      fmt::format("{:<28} {:>8} {:>19} {:>23} {:>15} {:>7}\n", "sheet, by its border", "markers",
                  "tilt +- deg", "x, y, z +- mm", "off the truth", "misfit");
  for (const SheetFigures& figures : sheets) {
    const SheetPose& pose = figures.pose;
    const Eigen::Vector3d at = pose.table_from_sheet.translation();
    const std::string off = figures.tilt_error_deg
                                ? fmt::format("{:.4f} deg", *figures.tilt_error_deg)
                                : std::string("-");
    text += fmt::format(
        "{:<28} {:>8} {:>9.4f} +- {:.4f} {:>6.1f} {:>5.1f} {:>5.1f} +- {:.3f} {:>14} {:>5.1f} %\n",
        std::filesystem::path(figures.name).filename().string(),
        fmt::format("{} of {}", pose.markers_used, pose.markers),
        TiltDeg(NormalOf(pose), Eigen::Vector3d::UnitZ()), TiltSdDeg(pose), at.x(), at.y(), at.z(),
        pose.position_sd_mm.norm(), off, 100.0 * pose.misfit);
  }
  return text + "\n";
}

nlohmann::json SheetsJson(const std::vector<SheetFigures>& sheets) {
  nlohmann::json json = nlohmann::json::array();
  for (const SheetFigures& figures : sheets) {
    const SheetPose& pose = figures.pose;
    const Eigen::Vector3d& sd_mm = pose.position_sd_mm;
    nlohmann::json one = {
        {"name", figures.name},           {"table_from_sheet", RowMajor(pose.table_from_sheet)},
        {"tilt_sd_deg", TiltSdDeg(pose)}, {"position_sd_mm", {sd_mm.x(), sd_mm.y(), sd_mm.z()}},
        {"markers", pose.markers_used},   {"markers_of_border", pose.markers},
        {"misfit", pose.misfit},          {"blur_px", pose.blur_px}};
    if (figures.tilt_error_deg) {
      one["tilt_error_deg"] = *figures.tilt_error_deg;
      one["position_error_mm"] = *figures.position_error_mm;
    }
    json.push_back(std::move(one));
  }
  return json;
}

}  // namespace sateen
