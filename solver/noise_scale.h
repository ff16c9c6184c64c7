#pragma once

#include <optional>

#include "core/task.h"
#include "imaging/light_stack.h"
#include "solver/least_squares.h"

namespace sateen {

// s^2 of solver/ladder.h, from some thousand pixels inside the mask, at equal distances in their own
// order: what is looked at depends neither on the threads nor on how much of the image the mask
// leaves out. Infinite where nothing tells of the noise.
[[nodiscard]] double NoiseScaleSquared(const LightStack& stack, const std::optional<Mask>& mask,
                                       const LeastSquaresRows& rows, bool known);

}  // namespace sateen
