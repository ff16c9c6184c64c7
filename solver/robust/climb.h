#pragma once

#include <array>
#include <cstdint>

#include "solver/ladder.h"
#include "solver/least_squares/least_squares.h"
#include "solver/light_doubt.h"
#include "solver/lobe/lobe.h"
#include "solver/robust/rungs.h"

namespace sateen {

// One solve by the ladder.
struct Climb {
  FramesInput input;
  const LadderOptions& options;
  const LeastSquaresRows& rows;
  const StackNoise& noise;
  double scale_squared = 1.0;         // s^2
  std::array<float, 256> limit = {};  // largest explained misfit, by usable samples
  std::optional<LightDoubt> light_doubt;
  std::optional<Lobe> lobe;
};

// Computes the limits of the misfits and the doubt about the lights.
[[nodiscard]] Climb MakeClimb(const FramesInput& input, const LadderOptions& options,
                              const LeastSquaresRows& rows, const StackNoise& noise,
                              double scale_squared);

// Returns the number of rows to give to SolveAndClimb(): several pieces, because the few pixels of
// one piece that climb do not fill a vector.
[[nodiscard]] int RowsPerClimb(ImageSize size);

// Solves rows [begin, end) on all rungs, piece by piece while their samples are in the cache.
[[nodiscard]] PieceSummary SolveAndClimb(const Climb& climb, int begin, int end,
                                         NormalField& field);

}  // namespace sateen
