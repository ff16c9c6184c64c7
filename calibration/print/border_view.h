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
  std::vector<Eigen::Vector3d> points_mm;    // four a marker
  std::vector<Eigen::Vector2d> corners_px;   // likewise
  std::vector<Eigen::Vector2d> straight_px;  // likewise, as a lens without distortion shows them
  size_t seen = 0;                           // markers of the dictionary, the border's or not
};

[[nodiscard]] BorderView LookForBorder(const Image<float>& picture, const Camera& camera,
                                       const SheetBorder& border);

// Those whose corners lie as on one flat sheet, each to within the slack.
[[nodiscard]] BorderView InPlace(const BorderView& view, double slack_px);

}  // namespace sateen
