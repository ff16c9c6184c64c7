#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "rig/rig.h"

// A rig in which no two figures are alike. In a symmetric one a swap of x and y, of fx and fy, of
// width and height or of two lights cancels out, and no test can fail of it.
namespace sateen::testing {

inline Camera LopsidedCamera() {
  Camera camera;
  camera.model = "lopsided";
  camera.size_px = {96, 70};
  camera.fx = 301.0;
  camera.fy = 347.0;
  camera.cx = 43.25;
  camera.cy = 38.5;
  // Looks down from beside the table's origin, turned and tilted.
  const Eigen::AngleAxisd turn(0.3, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd tilt(0.11, Eigen::Vector3d(0.8, 0.6, 0.0));
  camera.table_from_camera.linear() =
      (turn * tilt).toRotationMatrix() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.table_from_camera.translation() = Eigen::Vector3d(21, -34, 540);
  return camera;
}

inline Rig LopsidedRig() {
  const auto near = [](const char* name, int channel, const Eigen::Vector3d& position_mm,
                       const Eigen::Vector3d& flux_rgb) {
    return Light{.name = name,
                 .channel = channel,
                 .model = LightModel::kNear,
                 .position_mm = position_mm,
                 .flux_rgb = flux_rgb};
  };
  Rig rig;
  rig.camera = LopsidedCamera();
  rig.lights = {near("a", 3, {310, 40, 420}, {0.21, 0.24, 0.19}),
                near("b", 1, {-90, 290, 515}, {0.33, 0.31, 0.28}),
                near("c", 7, {-350, -120, 380}, {0.17, 0.20, 0.22}),
                near("d", 4, {60, -270, 460}, {0.26, 0.23, 0.30}),
                near("e", 2, {150, 170, 600}, {0.36, 0.34, 0.39})};
  return rig;
}

// Returns the point of the table under pixel (u, v) of a camera without distortion, from its
// figures alone: the reference for the functions of rig/projection.h.
inline Eigen::Vector3d TablePointByHand(const Camera& camera, double u, double v) {
  const Eigen::Vector3d in_camera((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
  const Eigen::Matrix3d& r = camera.table_from_camera.linear();
  const Eigen::Vector3d& eye = camera.table_from_camera.translation();
  const Eigen::Vector3d along = r * in_camera;
  return eye - eye.z() / along.z() * along;
}

}  // namespace sateen::testing
