#include "rig/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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
  if (!(pose.translation().allFinite() && pose.translation().z() > 0.0)) {
    return Fail(ErrorCode::kBadData,
                "{}.table_from_camera: the camera is at z = {:.6g} mm; need z > 0, above the table",
                what, pose.translation().z());
  }
  return {};
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
  if (!(std::isfinite(fx) && std::isfinite(fy) && fx > 0.0 && fy > 0.0)) {
    return Fail(ErrorCode::kBadData, "{}.k: fx = {:.6g}, fy = {:.6g}; need focal lengths > 0 px",
                what, fx, fy);
  }
  if (!(std::isfinite(cx) && std::isfinite(cy))) {
    return Fail(ErrorCode::kBadData, "{}.k: cx = {:.6g}, cy = {:.6g}; need finite numbers", what,
                cx, cy);
  }
  if (!std::all_of(distortion.begin(), distortion.end(),
                   [](double k) { return std::isfinite(k); })) {
    return Fail(ErrorCode::kBadData, "{}.distortion: [{}]; need finite numbers", what,
                fmt::join(distortion, ", "));
  }
  return has_pose ? CheckPose(table_from_camera, what) : Status();
}

}  // namespace sateen
