#pragma once

#include <optional>

#include "rig/camera.h"

// From points of the table to pixels and back; equations (1) to (4) are those of rig/camera.h.
namespace sateen {

// Returns the pixel (u, v) that shows a table point, by equations (1) to (4). The point must lie
// before the camera.
[[nodiscard]] Eigen::Vector2d PixelOfTablePoint(const Camera& camera,
                                                const Eigen::Vector3d& x_mm_in_table);

// Returns the unit vector in the table frame along which pixel (u, v) looks: equations (2) and (3)
// inverted by Newton's method. Nothing where the distortion cannot be inverted.
[[nodiscard]] std::optional<Eigen::Vector3d> RayOfPixel(const Camera& camera, double u, double v);

// Returns the point where that ray meets the plane z = height_mm. Nothing where it does not.
[[nodiscard]] std::optional<Eigen::Vector3d> TablePointOfPixel(const Camera& camera, double u,
                                                               double v, double height_mm = 0.0);

// Returns the camera without its distortion: the ideal pinhole camera of --undistort.
[[nodiscard]] Camera PinholeOf(const Camera& camera);

// Returns the pixel of `camera` that shows what pixel (u, v) of PinholeOf(camera) shows, by
// equations (2) to (4). Nothing beyond the angle to which the distortion can be inverted.
[[nodiscard]] std::optional<Eigen::Vector2d> PixelOfPinholePixel(const Camera& camera, double u,
                                                                 double v);

// Returns a camera `distance_mm` above the table's origin that looks straight down and sees
// `width_mm` of the table across its width; x right and y up in the image, no distortion.
[[nodiscard]] Camera OverheadCamera(ImageSize size_px, double distance_mm, double width_mm);

}  // namespace sateen
