#pragma once

#include "solver/lambertian.h"
#include "solver/solve_input.h"

namespace sateen {

// Solves the pixels of rows [row_begin, row_end) whose reason is `which` by one of the double
// backends (kJacobiSvd, kQr, kLdlt), into `field`. Rows are independent of each other.
void SolveRowsInDouble(const FramesInput& input, const LambertianOptions& options, Backend backend,
                       Reason which, int row_begin, int row_end, NormalField& field);

}  // namespace sateen
