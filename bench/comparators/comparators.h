#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "imaging/light_stack.h"
#include "rig/rig.h"
#include "solver/lambertian.h"

namespace sateen {

// Solvers of a normal per pixel, on one thread, in dynamic double matrices, as in their authors'
// code.
enum class Comparator {
  kBdcSvd,         // least squares of the whole image at once, every sample; distant lights alone
  kLeastSquares,   // per pixel, usable samples, as the three below
  kHuber,          // reweighted, threshold 1 % of the brightest sample
  kL1,             // reweighted
  kSparseBayesian  // Ikehata, Wipf, Matsushita and Aizawa 2012
};

[[nodiscard]] std::string_view Name(Comparator comparator);
// Returns those that are worth their time on so many lights.
[[nodiscard]] std::vector<Comparator> ComparatorsFor(const Rig& rig);

// Normals and reasons alone; usable samples are the solver's.
[[nodiscard]] NormalField SolveBy(Comparator comparator, const LightStack& stack, const Rig& rig,
                                  const std::optional<Mask>& mask);

}  // namespace sateen
