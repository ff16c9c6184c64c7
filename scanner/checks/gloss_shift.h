#pragma once

#include <Eigen/Core>
#include <vector>

#include "scanner/checks/frame_registration.h"

namespace sateen {

/// Takes out of the shifts what the highlights of a glossy yarn wander with the light, and adds
/// what is left of the jumps to their standard deviations:
///
///     d_k -= B l_k,   min over B of sum_k |(d_k - d_k-1) - B (l_k - l_k-1)|                  (1)
///     sd_k^2 += (med_k |(d_k - d_k-1) - B (l_k - l_k-1)|)^2, but not of the last frame       (2)
///
/// `l`  x and y of each frame's light less the first frame's; the last frame has the first light
///      again
void TakeOutGloss(const std::vector<Eigen::Vector2d>& l, std::vector<Shift>& shifts);

}  // namespace sateen
