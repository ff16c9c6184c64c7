#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/lights/light_residuals.h"
#include "core/error.h"
#include "rig/light.h"

namespace sateen {

struct RobustFit {
  Light light;
  std::vector<size_t> used = {};  // of the indices: those that follow the light
  int iterations = 0;
  Eigen::MatrixXd covariance = {};  // as of LightDescent
};

/// Fits one rung of the model ladder to samples of which some follow no light: rounds of Cauchy's
/// loss as wide as the residuals then are, so that it closes in on those that follow the light; then
/// squares without what lies further off than 4 robust standard deviations.
///
/// Errors  kDegenerate: fewer than half of the samples follow one light; as Descend
[[nodiscard]] Result<RobustFit> FitRobustly(const LightResiduals& residuals, LightModel model,
                                            const Light& start, const std::vector<size_t>& indices,
                                            bool with_covariance);

}  // namespace sateen
