#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calibration/response/chart_readings.h"

namespace sateen {

// The chart under one light.
struct LightBalance {
  Eigen::Vector3d white_balance = Eigen::Vector3d::Ones();  // factors; green is 1
  Eigen::Vector3d sd = Eigen::Vector3d::Zero();             // of those
  size_t patches = 0;                                       // that could be used
};

/// The white balance of each light k from neutral patches of known reflectance rho,
///
///     w_kc = exp mean ln (s_G rho_c / (s_c rho_G)),        w_kG = 1                         (1)
///
/// over the patches of all its frames of which all colours are there, weighted by their noise. Within
/// a patch of a frame the light's shading over the chart, its flicker and the exposure time cancel.
/// The standard deviation is the larger of that of the noise and that from how patches differ.
///
/// samples  linear ones, of signals above 0
/// Returns  for each light; nothing where it has no patch
[[nodiscard]] std::vector<std::optional<LightBalance>> BalanceLights(
    const std::vector<PatchSample>& samples, const std::vector<Eigen::Vector3d>& reflectance_rgb,
    size_t lights);

}  // namespace sateen
