#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

/// A pinhole camera with OpenCV's distortion, and where it stands.
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
  // False between the calibrations of lens and pose: table_from_camera is not known.
  bool has_pose = true;

  // Names the first field that is out of range, with its value and its range.
  [[nodiscard]] Status Validate(std::string_view what) const;

  bool operator==(const Camera& other) const;
};

// Where the table point appears, by equations (1) to (4). The point must lie before the camera.
[[nodiscard]] Eigen::Vector2d PixelOfTablePoint(const Camera& camera,
                                                const Eigen::Vector3d& x_mm_in_table);

// Unit vector in the table frame along which pixel (u, v) looks: equations (2) and (3) inverted
// by Newton's method. Nothing where the distortion cannot be inverted there.
[[nodiscard]] std::optional<Eigen::Vector3d> RayOfPixel(const Camera& camera, double u, double v);

// Where that ray meets the plane z = height_mm. Nothing where it does not.
[[nodiscard]] std::optional<Eigen::Vector3d> TablePointOfPixel(const Camera& camera, double u,
                                                               double v, double height_mm = 0.0);

// The same camera without distortion: the ideal pinhole camera of --undistort.
[[nodiscard]] Camera PinholeOf(const Camera& camera);

// Where the camera's own picture shows what pixel (u, v) of PinholeOf(camera) shows: equations (2)
// to (4). Nothing beyond the angle to which the distortion can be inverted.
[[nodiscard]] std::optional<Eigen::Vector2d> PixelOfPinholePixel(const Camera& camera, double u,
                                                                 double v);

// A camera straight above the table's origin at `distance_mm`, x right and y up in the image, that
// sees `width_mm` of the table across its width; no distortion.
[[nodiscard]] Camera OverheadCamera(ImageSize size_px, double distance_mm, double width_mm);

}  // namespace sateen
