#include "rig/camera.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "rig/plausible.h"

namespace sateen {
namespace {

constexpr double kRotationTolerance = 1e-6;  // bound on R^T R - 1; files may round to seven digits
constexpr int kMaxSizePx = 65536;

Status CheckPose(const Eigen::Isometry3d& pose, std::string_view what) {
  const Eigen::Matrix3d rotation = pose.linear();
  const double error =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).lpNorm<Eigen::Infinity>();
  if (!(error <= kRotationTolerance && rotation.determinant() > 0.0)) {
    return Fail(ErrorCode::kBadData,
                "{}.table_from_camera: the rotation is off by {:.3g} with determinant {:.6g}; need "
                "orthonormal rows to {:.0e} and determinant 1",
                what, error, rotation.determinant(), kRotationTolerance);
  }
  if (pose.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    return Fail(ErrorCode::kBadData,
                "{}.table_from_camera: the last row is [{}]; need [0, 0, 0, 1]", what,
                fmt::join(pose.matrix().row(3), ", "));
  }
  const Eigen::Vector3d at_mm = pose.translation();
  const std::string place = fmt::format("{}.table_from_camera:", what);
  if (!(at_mm.z() > 0.0)) {
    return Fail(ErrorCode::kBadData,
                "{} the camera is at z = {:.6g} mm; need z > 0, above the table", place, at_mm.z());
  }
  return CheckPlausible(place, " the camera's x or y", {at_mm.x(), at_mm.y()}, kPlausiblePlace)
      .and_then(
          [&] { return CheckPlausible(place, " the camera's z", {at_mm.z()}, kPlausibleHeight); });
}

}  // namespace

bool Camera::operator==(const Camera& other) const {
  return model == other.model && size_px == other.size_px && fx == other.fx && fy == other.fy &&
         cx == other.cx && cy == other.cy && distortion == other.distortion &&
         table_from_camera.matrix() == other.table_from_camera.matrix() &&
         has_pose == other.has_pose;
}

Status Camera::Validate(std::string_view what) const {
  if (size_px.width < 1 || size_px.height < 1 || size_px.width > kMaxSizePx ||
      size_px.height > kMaxSizePx) {
    return Fail(ErrorCode::kBadData, "{}.size_px: {} x {}; need 1 to {} each", what, size_px.width,
                size_px.height, kMaxSizePx);
  }
  if (!(fx > 0.0 && fy > 0.0)) {
    return Fail(ErrorCode::kBadData, "{}.k: fx = {:.6g}, fy = {:.6g}; need focal lengths > 0 px",
                what, fx, fy);
  }
  const auto [k1, k2, p1, p2, k3] = distortion;
  Status status = CheckPlausible(what, ".k: fx or fy", {fx, fy}, kPlausibleFocal);
  if (status) {
    status = CheckPlausible(what, ".k: cx or cy", {cx, cy}, kPlausiblePrincipal);
  }
  if (status) {
    status = CheckPlausible(what, ".distortion: k1, k2 or k3", {k1, k2, k3}, kPlausibleRadial);
  }
  if (status) {
    status = CheckPlausible(what, ".distortion: p1 or p2", {p1, p2}, kPlausibleTangential);
  }
  if (!status) {
    return status;
  }
  return has_pose ? CheckPose(table_from_camera, what) : Status();
}

}  // namespace sateen
