#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/error.h"

namespace sateen {

struct ChartPatch {
  std::string name;
  Eigen::Vector3d reflectance_rgb = Eigen::Vector3d::Zero();  // (0, 1] each
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();        // in the chart: x right, y up
};

// A neutral chart: square patches of known reflectance. Its own frame has its origin in the middle.
struct Chart {
  std::string title;
  double patch_mm = 0.0;  // side of a patch
  std::vector<ChartPatch> patches;

  // kBadData names the first thing that is out of range. `what` is the file.
  [[nodiscard]] Status Validate(const std::string& what) const;
};

}  // namespace sateen
