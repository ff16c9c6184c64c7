#pragma once

#include "solver/lambertian.h"
#include "solver/noise.h"

namespace sateen {

// SolveLambertianInto, and rung 1 of solver/ladder.h where there is `noise`: then `misfit`, of the
// stack's size, receives equation (5) and field.uncertainty equation (4) with s = 1; field.model is
// of the right size and not filled.
[[nodiscard]] Status SolveLeastSquaresInto(const LightStack& stack, const Rig& rig,
                                           const std::optional<Mask>& mask,
                                           const LambertianOptions& options,
                                           const StackNoise* noise, const Task& task,
                                           NormalField& field, Image<float>* misfit);

}  // namespace sateen
