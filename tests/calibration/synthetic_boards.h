#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calibration/print/board_find.h"
#include "core/angle.h"
#include "rig/camera.h"
#include "rig/projection.h"
#include "simulation/random.h"

namespace sateen::testing {

inline Camera LensOf3000Px() {
  Camera camera = OverheadCamera({3000, 2000}, 600.0, 300.0);
  camera.fx = 6010.0;
  camera.fy = 6000.0;
  camera.cx = 1512.0;
  camera.cy = 985.0;
  camera.distortion = {-0.12, 0.15, 0.0006, -0.0004, 0.02};
  return camera;
}

// A board in front of the camera: turned about its normal, then tilted about an axis in its plane.
inline Eigen::Isometry3d CameraFromBoard(double turn_deg, double tilt_deg, double axis_deg,
                                         const Eigen::Vector3d& center_mm) {
  const Eigen::Vector3d axis(std::cos(axis_deg * kRadPerDeg), std::sin(axis_deg * kRadPerDeg), 0.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(tilt_deg * kRadPerDeg, axis).toRotationMatrix() *
                  Eigen::Vector3d(1, -1, -1).asDiagonal() *
                  Eigen::AngleAxisd(turn_deg * kRadPerDeg, Eigen::Vector3d::UnitZ());
  pose.translation() = center_mm;
  return pose;
}

// The corners that lie in the image, with normal noise.
inline BoardView SeenBoard(const Camera& lens, const BoardSpec& spec,
                           const Eigen::Isometry3d& camera_from_board, double noise_px,
                           uint64_t seed) {
  Camera camera = lens;
  camera.table_from_camera.setIdentity();
  BoardView view = {.size_px = lens.size_px};
  for (int id = 0; id < spec.CornerCount(); ++id) {
    const auto count = static_cast<uint64_t>(id);
    const Eigen::Vector2d at = PixelOfTablePoint(camera, camera_from_board * spec.CornerPoint(id)) +
                               noise_px * Eigen::Vector2d(NormalDeviate(seed, 2 * count),
                                                          NormalDeviate(seed, 2 * count + 1));
    if (at.x() > 5 && at.y() > 5 && at.x() < lens.size_px.width - 6 &&
        at.y() < lens.size_px.height - 6) {
      view.ids.push_back(id);
      view.corners_px.push_back(at);
      view.points_mm.push_back(spec.CornerPoint(id));
    }
  }
  return view;
}

// Tilted each way by 35 degrees, all over the image.
inline std::vector<BoardView> TiltedViews(const Camera& lens, const BoardSpec& spec, int count,
                                          double noise_px, uint64_t seed,
                                          double distance_mm = 560.0) {
  std::vector<BoardView> views;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d center(40.0 * (i % 3 - 1), 30.0 * (i / 3 % 3 - 1),
                                 distance_mm + 10.0 * (i % 5));
    views.push_back(SeenBoard(lens, spec, CameraFromBoard(20.0 * i, 35.0, 75.0 * i, center),
                              noise_px, seed + static_cast<uint64_t>(i)));
  }
  return views;
}

}  // namespace sateen::testing
