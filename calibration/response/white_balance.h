#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibration/response/chart_readings.h"

namespace sateen {

// White balance of one light.
struct LightBalance {
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // factors; green is 1
  Eigen::Vector3d sd = Eigen::Vector3d::Zero();             // standard deviations
  size_t patches = 0;                                       // patches used
};

/// Returns the white balance of each light k from neutral patches of known reflectance rho,
///
///     w_kc = exp mean ln (s_G rho_c / (s_c rho_G)),        w_kG = 1                         (1)
///
/// over the patches of all its frames that have all three colours, weighted by their noise. Shading
/// over the chart, flicker and exposure time cancel in each patch. The standard deviation is the
/// larger of that of the noise and that of the differences between patches.
///
/// samples  linear samples with signals above 0
/// Returns  one per light; nothing where a light has no patch
[[nodiscard]] std::vector<std::optional<LightBalance>> BalanceLights(
    const std::vector<PatchSample>& samples, const std::vector<Eigen::Vector3d>& reflectance_rgb,
    size_t lights);

}  // namespace sateen
