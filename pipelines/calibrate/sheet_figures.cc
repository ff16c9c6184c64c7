#include "pipelines/calibrate/sheet_figures.h"

#include <cmath>
#include <utility>

#include "calibration/sheet/sheet_fault.h"
#include "core/angle.h"
#include "scanner/sessions/files/pose_json.h"

namespace sateen {
namespace {

Eigen::Vector3d NormalOf(const SheetPose& pose) { return pose.table_from_sheet.linear().col(2); }

}  // namespace

Result<SheetFigures> FiguresOfSheet(const std::filesystem::path& dir, const Sheet& sheet) {
  SheetFigures figures{.name = dir.string(), .pose = sheet.found_pose.value()};
  const Result<std::optional<Eigen::Isometry3d>> truth = ReadTruePose(dir);
  if (!truth) {
    return tl::unexpected(truth.error());
  }
  if (*truth) {
    figures.tilt_error_deg =
        AngleBetweenRad(NormalOf(figures.pose), (*truth)->linear().col(2)) * kDegPerRad;
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

double TiltDeg(const SheetPose& pose) {
  return AngleBetweenRad(NormalOf(pose), Eigen::Vector3d::UnitZ()) * kDegPerRad;
}

double TiltSdDeg(const SheetPose& pose) {
  return pose.rotation_sd_rad.head<2>().norm() * kDegPerRad;
}

}  // namespace sateen
