#pragma once

#include <optional>

#include "core/task.h"
#include "imaging/light_stack.h"
#include "solver/least_squares/least_squares.h"

namespace sateen {

struct NoiseScale {
  double scale_squared = 1.0;  // s^2 of solver/ladder.h; infinite where nothing tells of the noise
  MisfitSample sample;         // what it was read from
};

// From some thousand pixels inside the mask, at equal distances in their own
// order: what is looked at depends neither on the threads nor on how much of the image the mask
// leaves out.
[[nodiscard]] NoiseScale FindNoiseScale(const LightStack& stack, const std::optional<Mask>& mask,
                                        const LeastSquaresRows& rows, bool known);

}  // namespace sateen
