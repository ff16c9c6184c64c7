#pragma once

#include <Eigen/Core>
#include <vector>

#include "imaging/image.h"
#include "rig/camera.h"
#include "targets/sheet_border.h"

namespace sateen {

// Markers of the border that a picture shows, corner by corner.
struct BorderView {
  std::vector<int> ids;
  std::vector<Eigen::Vector3d> points_mm;    // corners on the sheet, four per marker
  std::vector<Eigen::Vector2d> corners_px;   // the same corners in the picture
  std::vector<Eigen::Vector2d> straight_px;  // the same by a lens without distortion
  size_t seen = 0;  // markers of the dictionary that were seen, of this border or not
};

// Finds the markers of the border in a picture.
[[nodiscard]] BorderView LookForBorder(const Image<float>& picture, const Camera& camera,
                                       const SheetBorder& border);

// Keeps the markers whose corners lie as on one flat sheet, each to within the slack.
[[nodiscard]] BorderView InPlace(const BorderView& view, double slack_px);

}  // namespace sateen
