#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "calibration/response/chart.h"
#include "calibration/response/chart_readings.h"
#include "imaging/raw.h"
#include "rig/camera.h"

namespace sateen {

// Where in the mosaic the sites of a patch are.
struct PatchPlaces {
  PatchSites sites;
  std::vector<size_t> index;                  // index in the mosaic, one per site
  std::array<Eigen::Vector2d, 4> corners_px;  // corners of what is read, in turn around it
};

/// Returns the sites in the middle 60 % of a patch, along each side, of a chart that lies on the
/// table. Returns none if it is out of the picture.
///
/// patch_mm  its side
/// mosaic    any of the camera: of it the size and the pattern of colours count
/// Cost      a ray for every pixel of the patch
[[nodiscard]] PatchPlaces PlacesOf(const ChartPatch& patch, double patch_mm, const Camera& camera,
                                   const Eigen::Isometry2d& table_from_chart,
                                   const RawMosaic& mosaic);

}  // namespace sateen
