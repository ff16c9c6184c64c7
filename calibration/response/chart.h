#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/error.h"

namespace sateen {

// Patch of a chart.
struct ChartPatch {
  std::string name;
  Eigen::Vector3d reflectance_rgb = Eigen::Vector3d::Zero();  // each in (0, 1]
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();        // in the chart: x right, y up
};

// Neutral chart: square patches of known reflectance. The origin of its frame is its middle.
struct Chart {
  std::string title;
  double patch_mm = 0.0;  // side of a patch
  std::vector<ChartPatch> patches;

  // Fails with kBadData on the first value out of range. `what` is the name of the file.
  [[nodiscard]] Status Validate(const std::string& what) const;
};

}  // namespace sateen
