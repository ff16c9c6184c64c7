#pragma once

#include <array>
#include <cstdint>

#include "solver/ladder.h"
#include "solver/least_squares/least_squares.h"
#include "solver/light_doubt.h"
#include "solver/lobe/lobe.h"
#include "solver/robust/rungs.h"

namespace sateen {

// What every pixel of a ladder's stack is judged by.
struct Climb {
  const LightStack& stack;
  const Rig& rig;
  const LadderOptions& options;
  const LeastSquaresRows& rows;
  const StackNoise& noise;
  double scale_squared = 1.0;         // s^2
  std::array<float, 256> limit = {};  // of the misfit, by usable samples
  std::optional<LightDoubt> light_doubt;
  std::optional<Lobe> lobe;
};

// The limits of equation (5)'s misfits.
[[nodiscard]] Climb MakeClimb(const LightStack& stack, const Rig& rig, const LadderOptions& options,
                              const LeastSquaresRows& rows, const StackNoise& noise,
                              double scale_squared);

// Rows that SolveAndClimb takes at a time: several pieces, because those few pixels of a piece that climb
// do not fill a vector.
[[nodiscard]] int RowsPerClimb(ImageSize size);

// All rungs for rows [begin, end), piece by piece while their samples are in the cache.
[[nodiscard]] PieceSummary SolveAndClimb(const Climb& climb, int begin, int end,
                                         NormalField& field);

}  // namespace sateen
