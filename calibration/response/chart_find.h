#pragma once

#include <Eigen/Geometry>

#include "calibration/response/chart.h"
#include "core/error.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "rig/light.h"

namespace sateen {

struct FindChartOptions {
  double max_shift_mm = 12.0;  // largest shift of the chart from the table's origin; (0, 1000]
  double max_turn_rad = 0.07;  // largest turn from a multiple of 90 degrees; [0, pi / 4]
};

// Pose of the chart on the table, and how well it explains the picture.
struct ChartPose {
  Eigen::Isometry2d table_from_chart = Eigen::Isometry2d::Identity();
  double misfit = 0.0;  // (1) of FindChart()
};

/// Finds a chart that lies near the middle of the table, turned by any multiple of 90 degrees, by
///
///     argmin over shift and turn  mean_j min(1, |log b(x_j) - log rho_j e(x_j) n.l(x_j) - m|)  (1)
///
/// where x_j are places in all patches, b is the picture's brightness there, rho the patch's
/// reflectance, e and l those of the light's model, and m the median of the differences. Edges
/// between patches tell the shift, reflectances the turn. A grid of 3 mm and 2 degrees is refined
/// to 0.1 mm.
///
/// cells    brightness, linear, black subtracted; cell (i, j) is the mean of sites 2i, 2i + 1
///          across and 2j, 2j + 1 down
/// Errors   kInvalidArgument: an option out of range
///          kBadData: (1) is above a third everywhere: the chart is not there
/// Cost     some 0.2 s for six patches
[[nodiscard]] Result<ChartPose> FindChart(const Image<float>& cells, const Camera& camera,
                                          const Light& light, const Chart& chart,
                                          const FindChartOptions& options = {});

}  // namespace sateen
