#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/lights/light_residuals.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

// Light fitted to the samples that follow it.
struct RobustFit {
  Light light;
  std::vector<size_t> used = {};  // indices of the samples that follow the light
  int iterations = 0;
  Eigen::MatrixXd covariance = {};  // as in LightDescent
};

/// Fits one rung of the model ladder to samples of which some follow no light. Rounds of Cauchy's
/// loss, each twice as wide as the residuals then are, close in on the samples that follow the
/// light. Then least squares are fitted to the samples within 4 robust standard deviations.
///
/// Errors  kDegenerate: fewer than half of the samples follow one light; as Descend
[[nodiscard]] Result<RobustFit> FitRobustly(const LightResiduals& residuals, LightModel model,
                                            const Light& start, const std::vector<size_t>& indices,
                                            bool with_covariance);

}  // namespace sateen
