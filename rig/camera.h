#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <string_view>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

/// Pinhole camera with OpenCV's distortion, and its pose. rig/projection.h computes with it.
///
///     x = X / Z, y = Y / Z, r^2 = x^2 + y^2                                    camera frame (1)
///     x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)                   (2)
///     y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y                   (3)
///     u = fx x' + cx, v = fy y' + cy                        pixel centres at integers       (4)
struct Camera {
  std::string model;
  ImageSize size_px;
  double fx = 0.0;  // [px]
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  std::array<double, 5> distortion = {};  // k1, k2, p1, p2, k3
  // Camera points (x right, y down, z forward) to table points, in millimetres.
  Eigen::Isometry3d table_from_camera = Eigen::Isometry3d::Identity();
  // True if table_from_camera is known; false between the calibrations of lens and pose.
  bool has_pose = true;

  // Fails with the first field that is out of range, its value and its range.
  [[nodiscard]] Status Validate(std::string_view what) const;

  bool operator==(const Camera& other) const;
};

}  // namespace sateen
